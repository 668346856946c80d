"""Tests of the rates between states: commanded, measured, and after the clock was set."""

import pytest
from diagnosis_examples import SMALL

from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_diagnosis.mending.state_periods import StatePeriods


def injecting(rate: float) -> dict[str, WellRate]:
    return {'injector': WellRate(rate, 0.5)}


@pytest.fixture
def periods() -> StatePeriods:
    return StatePeriods(SMALL)


def test_setpoints_hold_until_rates_are_measured(periods: StatePeriods) -> None:
    assert list(periods.until(0.0)) == []
    periods.rates.add_commanded(0.0, injecting(1e-7))
    assert list(periods.until(30.0)) == [RatePeriod(0.0, 30.0, injecting(1e-7))]
    periods.rates.add_known(KnownRates(40.0, 60.0, injecting(2e-7)))
    periods.rates.add_commanded(30.0, injecting(3e-7))  # whichever of both comes first
    assert list(periods.until(60.0)) == [
        RatePeriod(30.0, 40.0, injecting(3e-7)),
        RatePeriod(40.0, 60.0, injecting(2e-7)),
    ]


def test_without_rates_there_are_no_periods(periods: StatePeriods) -> None:
    assert [list(periods.until(stamp)) for stamp in (0.0, 30.0)] == [[], []]


def test_after_the_clock_was_set_back_earlier_rates_do_not_come_again(
    periods: StatePeriods,
) -> None:
    for stamp in (0.0, 30.0, 60.0, 90.0):
        periods.until(stamp)
        periods.rates.add_commanded(stamp, injecting(1e-9 * (1.0 + stamp)))
    periods.rates.add_known(KnownRates(100.0, 100.0, injecting(5e-9)))
    assert periods.is_other_clock(0.0)
    assert list(periods.until(0.0)) == []
    assert not periods.is_other_clock(30.0)
    periods.rates.add_commanded(10.0, injecting(7e-9))
    assert list(periods.until(30.0)) == [
        RatePeriod(0.0, 10.0, injecting(5e-9)),
        RatePeriod(10.0, 30.0, injecting(7e-9)),
    ]
