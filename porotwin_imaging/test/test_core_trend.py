"""The trend of cores: steady changes are found, single disturbances and steps are not."""

import numpy as np
import pytest

from porotwin_imaging.calibrating.calibration_evidence import PhotographEvidence
from porotwin_imaging.calibrating.core_trend import core_trend

NAN = float('nan')
STAINED = (0.47, 0.71, 0.86, 0.95, 1.0, 1.03, 1.05, 1.06, 1.06)


def photographs(levels) -> list[PhotographEvidence]:
    return [
        PhotographEvidence(100.0 * n, 1e-4 * n, 1e-4 * n, level, 200)
        for n, level in enumerate(levels, 1)
    ]


def test_cores_that_get_darker_and_stay_dark_rise() -> None:
    trend = core_trend(photographs(STAINED))
    assert trend is not None
    assert trend.rises
    assert (trend.first.core_level, trend.last.core_level) == (0.47, 1.06)


def test_a_slow_fall_below_the_noise_of_each_step_is_found() -> None:
    trend = core_trend(photographs(np.linspace(1.06, 0.94, 13)))
    assert trend is not None
    assert not trend.rises


def test_a_photograph_without_a_core_is_passed_over() -> None:
    trend = core_trend(photographs((NAN, *STAINED[:4], NAN, *STAINED[4:], NAN)))
    assert trend is not None
    assert trend.first.time == 200.0


@pytest.mark.parametrize(
    'levels',
    [
        (),
        (NAN, NAN),
        (1.0,) * 9,
        (0.5, 1.0, 1.0, 1.0, 1.0),  # a hand in the first photograph
        (0.8, 0.81, 0.8, 1.0, 1.01, 1.0),  # a lamp
        (0.7, 0.8, 1.2, 1.1, 0.9, 1.3),  # hands and shadows
        (0.8, 1.0, 1.2),  # too few
    ],
)
def test_steady_disturbed_and_switched_cores_have_no_trend(levels) -> None:
    assert core_trend(photographs(levels)) is None


def test_noise_alone_hardly_makes_a_trend() -> None:
    generator = np.random.default_rng(5)
    noisy = 1 + 0.007 * generator.standard_normal((500, 9))
    assert sum(core_trend(photographs(levels)) is not None for levels in noisy) == 0


def test_a_trend_is_found_within_the_noise_of_cores() -> None:
    generator = np.random.default_rng(5)
    noisy = np.array(STAINED) + 0.007 * generator.standard_normal((200, 9))
    assert sum(core_trend(photographs(levels)) is not None for levels in noisy) > 180
