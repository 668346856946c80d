"""The error from light follows from the light that was corrected."""

import numpy as np
import pytest

from porotwin_imaging.tracer.calibration import Calibration, Response
from porotwin_imaging.tracer.light_error import SeenTracer, light_error
from porotwin_imaging.tracer.tracer_signal import TracerSignal

CALIBRATION = Calibration(
    TracerSignal('difference', (1.0, 0.0, 0.0)), Response((0.0, 0.7), (0.0, 1.0))
)


def test_the_error_is_that_of_the_light_times_the_slope_of_the_response() -> None:
    ratio = np.zeros((1, 3, 3), np.float32)
    ratio[0, 1] = np.log([0.3, 0.62, 0.42])  # stock leaves less light that can be wrong
    values = np.array([[0.0, 1.0, np.nan]])
    factors, even = np.ones((1, 3)), np.zeros((1, 3))
    wrong = SeenTracer(ratio, even + 0.01**2, factors, values)
    found = light_error(wrong, CALIBRATION)
    assert found[0, :2] == pytest.approx([0.01 / 0.7, 0.3 * 0.01 / 0.7], rel=0.02)
    assert not light_error(SeenTracer(ratio, even, factors, values), CALIBRATION).any()
