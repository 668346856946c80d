"""The standard deviation of a map: what averages out, and where it grows."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.smoothing.level_smoothing import SmoothedMap
from porotwin_imaging.smoothing.map_deviation import NOISE, map_deviation
from porotwin_imaging.tracer.calibration import Calibration, Response

GRID = Grid(30, 20, 0.3, 0.2)
EXACT = Calibration(scale_error=0.0)
LEFT = NOISE.remaining_noise
"""Noise of a map relative to the propagated one."""


def even(value: float, noise: float = 0.0) -> SmoothedMap:
    """Return an even map with `noise` left."""
    return SmoothedMap(np.full(GRID.shape, value), np.full(GRID.shape, noise / LEFT))


def test_an_even_map_with_an_exact_calibration_has_its_noise() -> None:
    found = map_deviation(even(0.5, 0.01), 0.0, EXACT, GRID)
    np.testing.assert_allclose(found.total, 0.01)
    np.testing.assert_allclose(found.systematic, 0.0)


def test_scale_and_response_are_systematic() -> None:
    scaled = map_deviation(even(0.5, 0.01), 0.0, replace(EXACT, scale_error=0.04), GRID)
    np.testing.assert_allclose(scaled.systematic, 0.02)
    np.testing.assert_allclose(scaled.total, np.hypot(0.01, 0.02))
    bent = Response((0.0, 0.4, 0.8), (0.0, 0.5, 1.0), (0.0, 0.03, 0.0))
    curved = map_deviation(even(0.5), 0.0, replace(EXACT, response=bent), GRID)
    np.testing.assert_allclose(curved.systematic, 0.03)


def test_wrong_light_is_random() -> None:
    found = map_deviation(even(0.5, 0.03), np.full(GRID.shape, 0.04), EXACT, GRID)
    np.testing.assert_allclose(found.total, 0.05)
    np.testing.assert_allclose(found.systematic, 0.0)


def test_the_place_of_a_front_is_systematic() -> None:
    ramp = np.broadcast_to(GRID.x / GRID.width, GRID.shape)
    found = map_deviation(SmoothedMap(ramp, np.zeros(GRID.shape)), 0.0, EXACT, GRID)
    expected = NOISE.place_error  # the slope is 1 / width
    assert found.systematic[10, 15] == pytest.approx(expected, rel=0.01)


def test_faint_values_may_be_clean_sand() -> None:
    faint, clear = (map_deviation(even(v, 0.01), 0.0, EXACT, GRID).total for v in (0.02, 0.1))
    np.testing.assert_allclose(faint, np.hypot(0.01, 0.01))
    np.testing.assert_allclose(clear, 0.01)


def test_hidden_cells_have_no_deviation_and_spoil_no_others() -> None:
    values = np.full(GRID.shape, 0.5)
    values[:5] = np.nan
    found = map_deviation(SmoothedMap(values, 0.01 / LEFT + 0 * values), 0.0, EXACT, GRID)
    np.testing.assert_array_equal(np.isnan(found.total), np.isnan(values))
    np.testing.assert_allclose(found.total[5:], 0.01)
