"""Darcy flow: the divergence equals the sources, and known flows have their shape."""

import gc
import weakref

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_solver.coefficients.physics import SourceSink
from porotwin_solver.coefficients.water_contact import contact_of
from porotwin_solver.flow.flow import Flow, FlowCache

CLOSED = Boundaries(top='closed')
OPEN = Boundaries(top='open', bottom='open', left='open', right='open')
GRID = Grid(31, 17, 0.934, 0.562)


def random_mobility(seed: int, decades: float = 3.5) -> np.ndarray:
    """Return a field that spans `decades` orders of magnitude."""
    return 1e-8 * 10 ** np.random.default_rng(seed).uniform(-decades, 0.0, GRID.shape)


@pytest.mark.parametrize('boundaries', [Boundaries(), CLOSED, OPEN], ids=['top', 'closed', 'open'])
def test_the_divergence_is_the_source_to_round_off(boundaries: Boundaries) -> None:
    source = np.zeros(GRID.shape)
    source[4, 5], source[11, 25] = 1.4e-7, -1.4e-7
    flux = Flow(GRID, random_mobility(3), contact_of(GRID, boundaries.bodies)).flux(source)
    np.testing.assert_allclose(flux.divergence(), source, atol=1e-14 * 1.4e-7)


def test_no_water_passes_closed_sides() -> None:
    source = np.zeros(GRID.shape)
    source[4, 5] = 1e-7
    flux = Flow(GRID, random_mobility(4), contact_of(GRID, Boundaries().bodies)).flux(source)
    assert np.abs(flux.x[:, [0, -1]]).max() == 0.0
    assert np.abs(flux.z[0]).max() == 0.0
    assert flux.z[-1].sum() == pytest.approx(1e-7, rel=1e-12)


@pytest.mark.parametrize('shape', [(1, 12), (12, 1)], ids=['one column', 'one row'])
def test_a_closed_line_of_cells_carries_the_pumped_rate(shape) -> None:
    grid = Grid(*shape, 0.934, 0.562)
    source = np.zeros(grid.shape)
    source.flat[2], source.flat[9] = 1e-7, -1e-7
    flux = Flow(grid, np.full(grid.shape, 1e-8), contact_of(grid, CLOSED.bodies)).flux(source)
    np.testing.assert_allclose(flux.divergence(), source, atol=1e-20)
    through = flux.z[1:-1, 0] if shape[0] == 1 else flux.x[0, 1:-1]
    np.testing.assert_allclose(
        through, 1e-7 * ((np.arange(11) >= 2) & (np.arange(11) < 9)), atol=1e-20
    )


def test_a_single_closed_cell_has_no_flux() -> None:
    grid = Grid(1, 1, 0.934, 0.562)
    flux = Flow(grid, np.full((1, 1), 1e-8), contact_of(grid, CLOSED.bodies)).flux(np.zeros((1, 1)))
    assert not flux.x.any() and not flux.z.any()


def test_layers_carry_flow_in_proportion_to_their_mobility_thickness() -> None:
    mobility_thickness = np.repeat(10.0 ** -np.arange(6.0, 23.0)[:, None], 31, axis=1) * 1e3
    sides = Boundaries(top='closed', left='open', right='open')
    source = np.zeros(GRID.shape)
    source[:, 0] = 1e-7 * mobility_thickness[:, 0] / mobility_thickness[:, 0].sum()
    flux = Flow(GRID, mobility_thickness, contact_of(GRID, sides.bodies)).flux(source)
    leaving = flux.x[:, -1]
    np.testing.assert_allclose(leaving / leaving.sum(), source[:, 0] / 1e-7, rtol=1e-9)


def test_the_flux_does_not_depend_on_a_common_factor_of_the_permeability() -> None:
    source = np.zeros(GRID.shape)
    source[4, 5], source[11, 25] = 1e-7, -1e-7
    one = Flow(GRID, random_mobility(5), contact_of(GRID, Boundaries().bodies)).flux(source)
    other = Flow(GRID, 7.0 * random_mobility(5), contact_of(GRID, Boundaries().bodies)).flux(source)
    np.testing.assert_allclose(one.x, other.x, atol=1e-18)


def test_the_flow_of_the_same_coefficients_is_factorised_once() -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    mobility_thickness = np.full(grid.shape, 2e-9)
    cache = FlowCache(max_cells=10_000)
    first = cache.flow(grid, mobility_thickness, contact_of(grid, Boundaries().bodies))
    again = cache.flow(grid, mobility_thickness.copy(), contact_of(grid, Boundaries().bodies))
    assert again is first
    source_sink = SourceSink(0.4, 0.3)
    assert again.unit_flux(source_sink) is first.unit_flux(source_sink)
    unit = first.unit_flux(source_sink)
    assert unit.divergence().sum() == pytest.approx(1.0)
    mobility_thickness[0, 0] *= 1.0 + 1e-15
    assert cache.flow(grid, mobility_thickness, contact_of(grid, Boundaries().bodies)) is not first
    assert (
        cache.flow(
            grid, np.full(grid.shape, 2e-9), contact_of(grid, Boundaries(left='open').bodies)
        )
        is not first
    )


def test_the_cache_drops_the_flow_used_longest_ago() -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    cache = FlowCache(max_cells=2 * grid.nx * grid.nz)
    mobilities = [np.full(grid.shape, number * 1e-9) for number in (1.1, 1.2, 1.3)]
    flows = [
        cache.flow(grid, mobility_thickness, contact_of(grid, Boundaries().bodies))
        for mobility_thickness in mobilities
    ]
    again = [
        cache.flow(grid, mobilities[number], contact_of(grid, Boundaries().bodies))
        for number in (2, 1, 0)
    ]
    assert again[0] is flows[2]
    assert again[1] is flows[1]
    assert again[2] is not flows[0]


def test_a_discarded_flow_is_freed_at_once_with_its_factor() -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    flow_used = Flow(grid, np.full(grid.shape, 1.4e-9), contact_of(grid, Boundaries().bodies))
    flow_used.unit_flux(SourceSink(0.4, 0.3))
    held = weakref.ref(flow_used)
    gc.disable()
    try:
        del flow_used
        assert held() is None
    finally:
        gc.enable()
