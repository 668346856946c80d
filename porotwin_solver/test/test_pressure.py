"""The two-grid iteration for matrices too large to factorise, against the factor."""

import numpy as np
import pytest

from porotwin_core.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_solver import pressure
from porotwin_solver.flow import Flow

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
