"""Tests of the rates since the last photograph: interruptions, and clocks that go back."""

from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_siblings.continuity import periods_until


class Followed:
    """Stands for the siblings, with the time of their last photograph and all calls."""

    def __init__(self, time: float) -> None:
        self.time = time
        self.started = True
        self.told: list[str] = []

    def interrupt(self) -> None:
        self.started = False
        self.told.append('interrupt')

    def begin_anew(self) -> None:
        self.started = False
        self.told.append('begin anew')


def rates(number: float) -> dict[str, WellRate]:
    return {'a': WellRate(number * 1e-9)}


def log_of_a_person() -> RateHistory:
    """Return the rates of a person who sets every order 10 s after its photograph, up to 60 s."""
    log = RateHistory(rates(0.0), ('a',))
    for number, stamp in enumerate((0.0, 30.0, 60.0), 1):
        log.add_commanded(stamp, rates(number))
        log.add_known(KnownRates(stamp + 10.0, stamp + 10.0, rates(number)))
    return log


def test_the_rates_of_an_interval_begin_with_those_before_its_order_is_set() -> None:
    log, siblings = log_of_a_person(), Followed(0.0)
    assert periods_until(30.0, siblings, log, interrupted=False) == (
        RatePeriod(0.0, 10.0, rates(0)),
        RatePeriod(10.0, 30.0, rates(1)),
    )
    assert siblings.told == []


def test_rates_that_were_set_during_an_interruption_hold_after_it() -> None:
    log, siblings = log_of_a_person(), Followed(0.0)
    assert periods_until(90.0, siblings, log, interrupted=True) == ()
    assert siblings.told == ['interrupt']
    log.add_commanded(90.0, rates(4))
    siblings = Followed(90.0)
    (period,) = periods_until(120.0, siblings, log, interrupted=False)
    assert period == RatePeriod(90.0, 120.0, rates(3)), 'nobody has told yet that the order is set'


def test_a_clock_that_goes_back_begins_anew() -> None:
    log, siblings = log_of_a_person(), Followed(60.0)
    assert periods_until(30.0, siblings, log, interrupted=False) == ()
    assert siblings.told == ['begin anew']
    assert log.at(30.0) == rates(3), 'the pumps go on as they were'
