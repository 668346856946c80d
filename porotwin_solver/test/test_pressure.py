"""Multigrid for large matrices, compared with the factor."""

from functools import partial

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_solver.coefficients.physics import SourceSink
from porotwin_solver.coefficients.water_contact import contact_of
from porotwin_solver.flow import pressure
from porotwin_solver.flow.flow import Flow
from porotwin_solver.flow.pressure import Pressures, factorised

GRID = Grid(61, 37, 0.934, 0.562)  # odd: the last blocks are single rows and columns

multigrid = partial(Pressures, largest_factor=100)
"""A solver that iterates on GRID and three coarser grids."""

iterated = partial(Pressures, quick_factor=100)
"""A solver that iterates for a few sources and has a factor for many."""


@pytest.fixture(autouse=True)
def several_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the iteration have coarser grids on GRID."""
    monkeypatch.setattr(pressure, 'COARSEST_CELLS', 100)


@pytest.mark.parametrize(
    'boundaries', [Boundaries(), Boundaries(top='closed')], ids=['one', 'none']
)
@pytest.mark.parametrize('decades', [0.0, 3.5])
def test_multigrids_give_the_flux_of_the_factor(boundaries, decades) -> None:
    rng = np.random.default_rng(3)
    mobility_thickness = 1e-8 * 10 ** rng.uniform(-decades, 0.0, GRID.shape)
    source = np.zeros(GRID.shape)
    source[5, 9], source[30, 50] = 1.4e-7, -1.4e-7
    direct = Flow(GRID, mobility_thickness, contact_of(GRID, boundaries.bodies)).flux(source)
    found = Flow(
        GRID, mobility_thickness, contact_of(GRID, boundaries.bodies), make_pressures=multigrid
    ).flux(source)
    np.testing.assert_allclose(found.x, direct.x, atol=1e-12 * 1.4e-7)
    np.testing.assert_allclose(found.z, direct.z, atol=1e-12 * 1.4e-7)
    np.testing.assert_allclose(found.divergence(), source, atol=1e-14 * 1.4e-7)


def test_an_iteration_without_convergence_is_refused() -> None:
    impatient = partial(Pressures, largest_factor=100, max_iterations=2)
    source = np.zeros(GRID.shape)
    source[5, 9] = 1.4e-7
    mobility_thickness = 1e-8 * 10 ** np.random.default_rng(3).uniform(-3.5, 0.0, GRID.shape)
    with pytest.raises(InputError, match='61 x 37 cells: no convergence in 2 iterations'):
        Flow(
            GRID,
            mobility_thickness,
            contact_of(GRID, Boundaries().bodies),
            make_pressures=impatient,
        ).flux(source)


def test_a_single_well_is_iterated_and_many_sources_are_factorised(monkeypatch) -> None:
    made = []

    def counted(matrix):
        made.append(matrix.shape[0])
        return factorised(matrix)

    monkeypatch.setattr(pressure, 'factorised', counted)
    mobility_thickness = 1e-8 * 10 ** np.random.default_rng(3).uniform(-1.0, 0.0, GRID.shape)
    well = SourceSink(0.3, 0.2)
    flow = Flow(
        GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies), make_pressures=iterated
    )
    unit = flow.unit_flux(well)
    assert made
    assert max(made) <= 100
    np.testing.assert_allclose(
        unit.x,
        Flow(GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies)).unit_flux(well).x,
        atol=1e-12,
    )
    flow.flux(np.zeros(GRID.shape), unit)
    assert made.count(GRID.nx * GRID.nz) == 2  # of the small grid's own flow, and this one


def test_a_flow_that_would_take_too_many_iterations_is_factorised(monkeypatch) -> None:
    monkeypatch.setattr(pressure, 'WORTHWHILE_ITERATIONS', 2)
    mobility_thickness = 1e-8 * 10 ** np.random.default_rng(3).uniform(-9.0, 0.0, GRID.shape)
    well = SourceSink(0.3, 0.2)
    unit = Flow(
        GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies), make_pressures=iterated
    ).unit_flux(well)
    direct = Flow(GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies)).unit_flux(well)
    np.testing.assert_array_equal(unit.x, direct.x)


def test_a_unit_flow_of_a_closed_rig_is_iterated_to_round_off(monkeypatch) -> None:
    monkeypatch.setattr(Pressures, 'solve', None)  # no factor
    flow = Flow(
        GRID,
        np.full(GRID.shape, 1e-8),
        contact_of(GRID, Boundaries(top='closed').bodies),
        make_pressures=iterated,
    )
    one, other = flow.unit_flux(SourceSink(0.3, 0.2)), flow.unit_flux(SourceSink(0.7, 0.4))
    divergence = (one + other * -1.0).divergence()
    assert np.sort(np.abs(divergence).ravel())[-9] < 1e-14  # beside both wells


def test_an_iterated_flow_behind_a_tight_wall_is_solved_by_the_factor() -> None:
    mobility_thickness = np.full(GRID.shape, 1e-8)
    mobility_thickness[20] = 1e-20
    well = SourceSink(0.3, 0.2)
    unit = Flow(
        GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies), make_pressures=iterated
    ).unit_flux(well)
    direct = Flow(GRID, mobility_thickness, contact_of(GRID, Boundaries().bodies)).unit_flux(well)
    np.testing.assert_allclose(unit.x, direct.x, atol=1e-11)
    np.testing.assert_allclose(unit.z, direct.z, atol=1e-11)
