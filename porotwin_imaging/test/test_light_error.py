"""The error from light grows under shadow and veil, and not under tracer."""

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


def error(light: np.ndarray | float = 0.0, *, veil: float = 0.0) -> np.ndarray:
    """Return the error for a change of all channels by `light` [log], and an added `veil`."""
    left = 1.0 - plume()[..., None] * (1.0 - np.exp(STOCK))
    ratio = np.log(left + veil) + np.asarray(light)[..., None]
    values = np.clip((1.0 - np.exp(ratio[..., 0])) / 0.7, 0.0, 1.0)
    return light_error(SeenTracer(ratio, np.zeros(SHAPE), np.ones(SHAPE), values), CALIBRATION)


def test_in_good_light_the_error_is_small_and_larger_below_the_plume() -> None:
    found = error()
    assert found.max() < 0.006
    slope = 1.0 / 0.7
    assert found[20, 55] == pytest.approx(LIGHT_ERROR.measured * slope, rel=0.2)
    assert found[20, 26] > 2 * found[20, 55]


def test_the_error_grows_where_a_shadow_lies() -> None:
    shadow = np.where(np.arange(SHAPE[1]) > 42, np.log(0.8), 0.0) * np.ones(SHAPE)
    found = error(shadow)
    assert found[20, 52] > 0.1
    assert found[20, 38] < 0.5 * found[20, 52]


def test_a_veil_makes_all_values_less_certain_and_stock_most_in_light() -> None:
    assert error(veil=0.1)[20, 20] > 4 * error()[20, 20]


def test_without_stock_in_the_picture_the_colour_is_not_known() -> None:
    ratio = np.zeros((*SHAPE, 3))
    seen = SeenTracer(ratio, np.zeros(SHAPE), np.ones(SHAPE), np.zeros(SHAPE))
    np.testing.assert_allclose(
        light_error(seen, CALIBRATION), LIGHT_ERROR.measured / 0.7, rtol=0.05
    )


def test_a_fine_map_has_the_error_of_a_coarse_one() -> None:
    ratio = np.zeros((40, 1000, 3))
    seen = SeenTracer(ratio, np.zeros((40, 1000)), np.ones((40, 1000)), np.zeros((40, 1000)))
    found = light_error(seen, CALIBRATION)
    assert found.shape == (40, 1000)
    np.testing.assert_allclose(found, LIGHT_ERROR.measured / 0.7, rtol=0.05)
