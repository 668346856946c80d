"""The standard deviation of a map: what averages out and what does not."""

import numpy as np
import pytest

from porotwin_imaging.map_deviation import map_deviation
from porotwin_imaging.settings import DEFAULTS


def test_errors_of_light_and_scale_do_not_average_out() -> None:
    settings = DEFAULTS.noise
    found = map_deviation(np.full((5, 5), 1e-9), np.full((5, 5), 0.5), 0.02)
    assert found.total[2, 2] == pytest.approx(np.hypot(0.01, settings.light_error))
    averaged = map_deviation(np.full((5, 5), 0.11), np.zeros((5, 5)), 0.0)
    over = 1 + 2 * settings.averaging_reach_cells
    assert averaged.total[2, 2] == pytest.approx(np.hypot(0.11 / over, settings.light_error))
