"""Tests of the doubt about a front: its distance from the forecast, and wider bands."""

import math

import numpy as np
import pytest
from siblings_examples import GRID

from porotwin_core.geometry.grid import FloatArray
from porotwin_siblings.front_check import USUAL_MISS_M, FrontCheck, front_miss, widened

TIMES = np.array([300.0, 1200.0])
NOISE = np.random.default_rng(3).normal(0.0, 0.01, GRID.shape)


def plume(radius: float, x: float = 0.45) -> FloatArray:
    """Return a round plume of `radius` [m] with a front of some cells."""
    away = np.hypot(GRID.x[None, :] - x, GRID.z[:, None] - 0.25)
    return 0.5 * (1.0 - np.tanh((away - radius) / 0.05))


@pytest.mark.parametrize('seen', [plume(0.155), plume(0.15, 0.455)])
def test_a_larger_plume_and_a_shifted_one_are_off_by_the_same_distance(seen: FloatArray) -> None:
    assert front_miss(plume(0.15), seen + NOISE, GRID) == pytest.approx(0.005, rel=0.3)


def test_noise_is_no_miss_and_without_a_plume_there_is_none() -> None:
    assert front_miss(plume(0.15), plume(0.15) + NOISE, GRID) < 1e-3
    assert math.isnan(front_miss(np.zeros(GRID.shape), NOISE, GRID))


def test_usual_misses_add_nothing_and_large_ones_soon_do() -> None:
    check = FrontCheck()
    for _ in range(20):
        check.compare(USUAL_MISS_M)
    assert check.distances(TIMES) == pytest.approx(0.0, abs=1e-9)
    check.compare(math.nan)
    for _ in range(3):
        check.compare(4e-3)
    soon, late = check.distances(TIMES)
    assert soon > 3e-3
    assert late == pytest.approx(2.0 * soon), 'it grows with the root of the time ahead'


def test_a_front_before_the_zone_may_be_in_it() -> None:
    zone = np.zeros(GRID.shape)
    zone[:, 16:] = 1.0
    maps = np.array([plume(0.1, 0.3)])
    empty = np.zeros((3, 1))

    def measure(map_: FloatArray) -> float:
        return float((zone * (map_ > 0.05)).sum())

    near, far = (
        widened(empty, maps, np.array([distance]), GRID, measure)[2, 0] for distance in (0.01, 0.2)
    )
    assert widened(empty, maps, np.zeros(1), GRID, measure).max() == 0.0
    assert near < far > 5.0


def test_bands_keep_their_median_and_stay_positive() -> None:
    band = np.array([[10.0], [40.0], [60.0]])
    found = widened(band, np.array([plume(0.2)]), np.array([0.1]), GRID, lambda map_: map_.sum())
    assert found[1, 0] == 40.0
    assert 0.0 <= found[0, 0] < 10.0
    assert found[2, 0] > 60.0
