"""The two-grid iteration for matrices too large to factorise, against the factor."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_core.wells import WellRate
from porotwin_solver import coupling, pressure
from porotwin_solver.coupling import Coupling
from porotwin_solver.flow import Flow
from porotwin_solver.physics import nominal_physics

GRID = Grid(61, 37, 0.934, 0.562)  # odd: the last blocks are single rows and columns


@pytest.mark.parametrize(
    'boundaries', [Boundaries(), Boundaries(top='closed')], ids=['one', 'none']
)
@pytest.mark.parametrize('decades', [0.0, 3.5])
def test_two_grids_give_the_flux_of_the_factor(monkeypatch, boundaries, decades) -> None:
    rng = np.random.default_rng(3)
    conductance = 1e-8 * 10 ** rng.uniform(-decades, 0.0, GRID.shape)
    source = np.zeros(GRID.shape)
    source[5, 9], source[30, 50] = 1.4e-7, -1.4e-7
    direct = Flow(GRID, conductance, boundaries).flux(source)
    monkeypatch.setattr(pressure, 'LARGEST_FACTOR', 700)
    iterated = Flow(GRID, conductance, boundaries).flux(source)
    np.testing.assert_allclose(iterated.x, direct.x, atol=1e-12 * 1.4e-7)
    np.testing.assert_allclose(iterated.z, direct.z, atol=1e-12 * 1.4e-7)
    np.testing.assert_allclose(iterated.divergence(), source, atol=1e-14 * 1.4e-7)


def test_an_iteration_that_does_not_get_there_is_no_pressure(monkeypatch) -> None:
    monkeypatch.setattr(pressure, 'LARGEST_FACTOR', 700)
    monkeypatch.setattr(pressure, 'MOST_ITERATIONS', 2)
    source = np.zeros(GRID.shape)
    source[5, 9] = 1.4e-7
    conductance = 1e-8 * 10 ** np.random.default_rng(3).uniform(-3.5, 0.0, GRID.shape)
    with pytest.raises(InputError, match='61 x 37 cells: not found in 2 iterations'):
        Flow(GRID, conductance, Boundaries()).flux(source)


def test_viscosities_too_far_apart_are_refused(monkeypatch, rig) -> None:
    monkeypatch.setattr(coupling, 'MOST_ITERATIONS', 5)
    physics = nominal_physics(rig, rig.grid(30, 20))
    coupled = Coupling(replace(physics, viscosity_ratio=50.0))
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, (20, 30))
    with pytest.raises(InputError, match='viscosity_ratio 50: the pressure is not found in 5'):
        coupled.flux({next(iter(rig.wells)): WellRate(1e-7)}, concentration)
