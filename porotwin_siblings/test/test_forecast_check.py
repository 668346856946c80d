"""The doubt about areas that forecasts of the last half hour tell."""

import numpy as np
import pytest

from porotwin_core.model.effect_parameter import HALF_INTERVAL
from porotwin_siblings.forecast_check import LEAST_AREA, USUAL_AREA, ForecastCheck

BAND = np.array([[40e-4], [50e-4], [61e-4]])
SOON, LATE = np.array([300.0]), np.array([1200.0])


def area_check() -> ForecastCheck:
    return ForecastCheck(USUAL_AREA, LEAST_AREA)


def test_forecasts_that_miss_widen_the_bands_and_good_ones_narrow_them() -> None:
    poor, good, new = area_check(), area_check(), area_check()
    for _ in range(20):
        poor.compare(50e-4, 58e-4)
        good.compare(50e-4, 50.2e-4)
    assert new.error == USUAL_AREA
    assert good.error < 0.7 * new.error < 2.0 * new.error < poor.error
    widths = [np.ptp(check.widened(BAND, SOON)) for check in (good, new, poor)]
    assert np.ptp(BAND) < widths[0] < widths[1] < widths[2]


def test_the_doubt_grows_with_time_and_the_median_stays() -> None:
    check = area_check()
    soon, late = check.widened(BAND, SOON), check.widened(BAND, LATE)
    assert np.ptp(soon) < np.ptp(late)
    usual = np.ptp(late) / np.ptp(soon)
    for _ in range(20):
        check.compare(50e-4, 65e-4)
    assert np.ptp(check.widened(BAND, LATE)) / np.ptp(check.widened(BAND, SOON)) > 1.5 * usual
    assert soon[1] == late[1] == BAND[1]


def test_what_was_learnt_of_a_small_plume_holds_for_a_large_one() -> None:
    check = area_check()
    for _ in range(30):
        check.compare(4e-4, 5e-4)
    added = check.widened(np.full((3, 1), 400e-4), SOON)
    assert check.error == pytest.approx(1e-4 / np.sqrt(5e-4), rel=0.15)
    assert added[2, 0] - 400e-4 == pytest.approx(HALF_INTERVAL * np.sqrt(400e-4) * check.error)


def test_an_empty_zone_and_no_zone_tell_nothing() -> None:
    check = area_check()
    check.compare(0.0, 0.0)
    check.compare(np.nan, np.nan)
    assert check.error == USUAL_AREA
    assert (check.widened(np.zeros((3, 1)), SOON) == 0.0).all()
