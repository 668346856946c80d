"""The error from light grows below the plume."""

import numpy as np
import pytest

from porotwin_imaging.tracer.calibration import Calibration, Response
from porotwin_imaging.tracer.light_error import LIGHT_ERROR, SeenTracer, light_error
from porotwin_imaging.tracer.tracer_signal import TracerSignal

STOCK = np.log([0.3, 0.62, 0.42])
SHAPE = (40, 60)
CALIBRATION = Calibration(
    TracerSignal('difference', (1.0, 0.0, 0.0)), Response((0.0, 0.7), (0.0, 1.0))
)


def plume() -> np.ndarray:
    x, z = np.meshgrid(np.arange(SHAPE[1]), np.arange(SHAPE[0]))
    return np.clip(1.5 - np.hypot(x - 20, z - 20) / 12, 0.0, 1.0)


def error() -> np.ndarray:
    """Return the error in the light of the baseline."""
    ratio = np.log(1.0 - plume()[..., None] * (1.0 - np.exp(STOCK)))
    values = np.clip((1.0 - np.exp(ratio[..., 0])) / 0.7, 0.0, 1.0)
    return light_error(SeenTracer(ratio, np.zeros(SHAPE), np.ones(SHAPE), values), CALIBRATION)


def test_in_good_light_the_error_is_small_and_larger_below_the_plume() -> None:
    found = error()
    assert found.max() < 0.006
    slope = 1.0 / 0.7
    assert found[20, 55] == pytest.approx(LIGHT_ERROR.measured * slope, rel=0.2)
    assert found[20, 26] > 2 * found[20, 55]


def test_a_fine_map_has_the_error_of_a_coarse_one() -> None:
    ratio = np.zeros((40, 1000, 3))
    seen = SeenTracer(ratio, np.zeros((40, 1000)), np.ones((40, 1000)), np.zeros((40, 1000)))
    found = light_error(seen, CALIBRATION)
    assert found.shape == (40, 1000)
    np.testing.assert_allclose(found, LIGHT_ERROR.measured / 0.7, rtol=0.05)
