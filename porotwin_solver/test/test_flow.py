"""Darcy flow: what goes in comes out, exactly; shapes of known flows."""

import gc
import weakref

import numpy as np
import pytest

from porotwin_core.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_solver import flow
from porotwin_solver.background import background_flux
from porotwin_solver.flow import FaceField, Flow, flow_of
from porotwin_solver.physics import SourceSink, nominal_physics

CLOSED = Boundaries(top='closed')
OPEN = Boundaries(top='open', bottom='open', left='open', right='open')
GRID = Grid(31, 17, 0.934, 0.562)


def random_conductance(seed: int, decades: float = 3.5) -> np.ndarray:
    """Return a field that spans `decades` orders of magnitude."""
    return 1e-8 * 10 ** np.random.default_rng(seed).uniform(-decades, 0.0, GRID.shape)


@pytest.mark.parametrize('boundaries', [Boundaries(), CLOSED, OPEN], ids=['top', 'closed', 'open'])
def test_the_divergence_is_the_source_to_round_off(boundaries: Boundaries) -> None:
    source = np.zeros(GRID.shape)
    source[4, 5], source[11, 25] = 1.4e-7, -1.4e-7
    flux = Flow(GRID, random_conductance(3), boundaries).flux(source)
    np.testing.assert_allclose(flux.divergence(), source, atol=1e-14 * 1.4e-7)


def test_nothing_passes_closed_sides() -> None:
    source = np.zeros(GRID.shape)
    source[4, 5] = 1e-7
    flux = Flow(GRID, random_conductance(4), Boundaries()).flux(source)
    assert np.abs(flux.x[:, [0, -1]]).max() == 0.0
    assert np.abs(flux.z[0]).max() == 0.0
    assert flux.z[-1].sum() == pytest.approx(1e-7, rel=1e-12)


@pytest.mark.parametrize('shape', [(1, 12), (12, 1)], ids=['one column', 'one row'])
def test_a_closed_line_of_cells_carries_what_is_pumped_through_it(shape) -> None:
    grid = Grid(*shape, 0.934, 0.562)
    source = np.zeros(grid.shape)
    source.flat[2], source.flat[9] = 1e-7, -1e-7
    flux = Flow(grid, np.full(grid.shape, 1e-8), CLOSED).flux(source)
    np.testing.assert_allclose(flux.divergence(), source, atol=1e-20)
    through = flux.z[1:-1, 0] if shape[0] == 1 else flux.x[0, 1:-1]
    np.testing.assert_allclose(
        through, 1e-7 * ((np.arange(11) >= 2) & (np.arange(11) < 9)), atol=1e-20
    )


def test_a_closed_cell_rests() -> None:
    grid = Grid(1, 1, 0.934, 0.562)
    flux = Flow(grid, np.full((1, 1), 1e-8), CLOSED).flux(np.zeros((1, 1)))
    assert not flux.x.any() and not flux.z.any()


def test_layers_share_a_flow_along_them_by_their_conductance() -> None:
    conductance = np.repeat(10.0 ** -np.arange(6.0, 23.0)[:, None], 31, axis=1) * 1e3
    sides = Boundaries(top='closed', left='open', right='open')
    source = np.zeros(GRID.shape)
    source[:, 0] = 1e-7 * conductance[:, 0] / conductance[:, 0].sum()
    flux = Flow(GRID, conductance, sides).flux(source)
    leaving = flux.x[:, -1]
    np.testing.assert_allclose(leaving / leaving.sum(), source[:, 0] / 1e-7, rtol=1e-9)


def test_the_flux_does_not_depend_on_a_common_factor_of_the_permeability() -> None:
    source = np.zeros(GRID.shape)
    source[4, 5], source[11, 25] = 1e-7, -1e-7
    one = Flow(GRID, random_conductance(5), Boundaries()).flux(source)
    other = Flow(GRID, 7.0 * random_conductance(5), Boundaries()).flux(source)
    np.testing.assert_allclose(one.x, other.x, atol=1e-18)


def test_refined_fluxes_share_the_divergence_of_a_cell_equally() -> None:
    rng = np.random.default_rng(6)
    coarse = FaceField(rng.normal(size=(5, 8)), rng.normal(size=(6, 7)))
    fine = coarse.refined(3)
    expected = np.repeat(np.repeat(coarse.divergence(), 3, axis=0), 3, axis=1) / 9.0
    np.testing.assert_allclose(fine.divergence(), expected, atol=1e-14)
    through = fine.x[:, ::3].reshape(5, 3, 8).sum(axis=1)
    np.testing.assert_allclose(through, coarse.x, atol=1e-14)


def test_background_flow_is_uniform_in_a_homogeneous_rig(rig) -> None:
    from dataclasses import replace

    physics = nominal_physics(rig, rig.grid(31, 17))
    physics = replace(physics, background_flux=(2e-6, -1e-6))
    flux = background_flux(physics, physics.permeability)
    np.testing.assert_allclose(flux.x, 2e-6 * 0.010 * physics.grid.dz, rtol=1e-10)
    np.testing.assert_allclose(flux.z, -1e-6 * 0.010 * physics.grid.dx, rtol=1e-10)


def test_the_flow_of_the_same_coefficients_is_factorised_once() -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    conductance = np.full(grid.shape, 2e-9)
    first = flow_of(grid, conductance, Boundaries())
    again = flow_of(grid, conductance.copy(), Boundaries())
    assert again is first
    source_sink = SourceSink(0.4, 0.3)
    assert again.unit_flux(source_sink) is first.unit_flux(source_sink)
    unit = first.unit_flux(source_sink)
    assert unit.divergence().sum() == pytest.approx(1.0)
    conductance[0, 0] *= 1.0 + 1e-15
    assert flow_of(grid, conductance, Boundaries()) is not first
    assert flow_of(grid, np.full(grid.shape, 2e-9), Boundaries(left='open')) is not first


def test_flows_that_are_remembered_are_given_up_again(monkeypatch) -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    monkeypatch.setattr(flow, 'REMEMBERED_CELLS', 2 * grid.nx * grid.nz)
    conductances = [np.full(grid.shape, number * 1e-9) for number in (1.1, 1.2, 1.3)]
    flows = [flow_of(grid, conductance, Boundaries()) for conductance in conductances]
    again = [flow_of(grid, conductances[number], Boundaries()) for number in (2, 1, 0)]
    assert again[0] is flows[2]
    assert again[1] is flows[1]
    assert again[2] is not flows[0]


def test_a_flow_that_nobody_holds_is_gone_at_once_with_its_factor() -> None:
    grid = Grid(9, 7, 0.9, 0.7)
    flow_used = Flow(grid, np.full(grid.shape, 1.4e-9), Boundaries())
    flow_used.unit_flux(SourceSink(0.4, 0.3))
    held = weakref.ref(flow_used)
    gc.disable()
    try:
        del flow_used
        assert held() is None
    finally:
        gc.enable()
