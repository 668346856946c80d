"""The Wasserstein distance of plumes that were moved in a known way."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.measures.wasserstein import MOST_CELLS, TOLERANCE, map_distance

GRID = Grid(140, 80, 1.4, 0.8)
X, Z = np.meshgrid(GRID.x, GRID.z)


def blob(x: float, z: float, radius: float = 0.08) -> np.ndarray:
    return 0.5 * (1 - np.tanh((np.hypot(X - x, Z - z) - radius) / 0.01))


@pytest.mark.parametrize(
    'move', [(0.1, 0.0), (0.0, -0.1), (0.06, 0.08), (0.06, -0.08), (-0.5, 0.0)]
)
def test_a_moved_plume_has_the_distance_of_its_move(move) -> None:
    found = map_distance(blob(0.7, 0.4), blob(0.7 + move[0], 0.4 + move[1]), GRID)
    assert found.distance_m == pytest.approx(np.hypot(*move), rel=0.01)
    assert found.bound_m <= 0.5 * TOLERANCE * 1.01 * found.distance_m
    assert found.mass_change == pytest.approx(0.0, abs=1e-3)


def test_half_the_mass_is_told_beside_the_distance() -> None:
    found = map_distance(blob(0.6, 0.4), 0.5 * blob(0.7, 0.4), GRID)
    assert found.distance_m == pytest.approx(0.1, rel=0.01)
    assert found.mass_change == pytest.approx(-0.5, abs=1e-3)


def test_random_masses_against_the_exact_assignment() -> None:
    """Unit masses on cells: an assignment problem, which scipy solves exactly."""
    generator = np.random.default_rng(13)
    grid = Grid(40, 24, 1.0, 0.6)
    maps, places = [], []
    for _ in range(2):
        chosen = generator.choice(grid.nx * grid.nz, 60, replace=False)
        values = np.zeros(grid.nx * grid.nz)
        values[chosen] = 1.0
        maps.append(values.reshape(grid.shape))
        places.append(np.stack([grid.x[chosen % grid.nx], grid.z[chosen // grid.nx]], axis=1))
    costs = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)
    exact = costs[linear_sum_assignment(costs)].mean()
    # between lonely cells the gradient of the grid differs from the one of the plane
    assert map_distance(*maps, grid).distance_m == pytest.approx(exact, rel=0.06)


def test_the_same_map_has_no_distance_and_an_empty_one_none() -> None:
    values = blob(0.7, 0.4)
    assert map_distance(values, 2.0 * values, GRID).distance_m == 0.0
    assert np.isnan(map_distance(values, np.zeros(GRID.shape), GRID).distance_m)
    assert map_distance(values, np.zeros(GRID.shape), GRID).mass_change == -1.0
    assert np.isnan(map_distance(np.zeros(GRID.shape), values, GRID).mass_change)


def test_cells_that_one_map_does_not_show_count_in_neither() -> None:
    first, second = blob(0.5, 0.4), blob(0.6, 0.4) + blob(1.2, 0.4)
    second[:, 100:] = np.nan
    assert map_distance(first, second, GRID).distance_m == pytest.approx(0.1, rel=0.01)


def test_a_fine_map_is_averaged_first() -> None:
    fine = GRID.refined(4)
    assert fine.nx * fine.nz > MOST_CELLS
    first, second = (np.kron(one, np.ones((4, 4))) for one in (blob(0.5, 0.4), blob(0.6, 0.4)))
    assert map_distance(first, second, fine).distance_m == pytest.approx(0.1, rel=0.01)
