"""Tests of the rates in force: measured, confirmed, or as commanded."""

import math

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.rates_in_force import (
    MOST_PERIODS,
    KnownRates,
    RatePeriod,
    balanced,
    describe_difference,
    latest_known,
    rates_in_force,
    same_rates,
)
from porotwin_core.rates.wells import WellRate, net_rate


def push(rate_ml_h: float) -> dict[str, WellRate]:
    return {'push': WellRate(from_ml_h(rate_ml_h))}


COMMANDED, BEFORE, OTHER = push(300.0), push(50.0), push(400.0)


def periods(*known: KnownRates, start: float = 30.0, end: float = 60.0) -> list[RatePeriod]:
    return list(rates_in_force(known, start, end, commanded=COMMANDED, before=BEFORE))


def test_where_nothing_is_known_the_commanded_rates_count() -> None:
    assert periods() == [RatePeriod(30.0, 60.0, COMMANDED)]


def test_rates_measured_over_the_interval_replace_the_commanded_ones() -> None:
    assert periods(KnownRates(30.0, 60.0, OTHER)) == [RatePeriod(30.0, 60.0, OTHER)]


def test_rates_measured_over_a_part_leave_the_rest_as_commanded() -> None:
    found = periods(KnownRates(40.0, 50.0, OTHER))
    assert [(period.start, period.end) for period in found] == [(30, 40), (40, 50), (50, 60)]
    assert [period.rates for period in found] == [COMMANDED, OTHER, COMMANDED]


def test_confirmed_rates_hold_from_their_time_on_and_the_earlier_ones_before_it() -> None:
    found = periods(KnownRates(42.0, 42.0, OTHER))
    assert found == [RatePeriod(30.0, 42.0, BEFORE), RatePeriod(42.0, 60.0, OTHER)]


def test_rates_confirmed_twice_hold_one_after_the_other() -> None:
    found = periods(KnownRates(50.0, 50.0, COMMANDED), KnownRates(40.0, 40.0, OTHER))
    assert [(period.start, period.rates) for period in found] == [
        (30.0, BEFORE),
        (40.0, OTHER),
        (50.0, COMMANDED),
    ]


def test_rates_from_before_the_interval_hold_over_all_of_it() -> None:
    assert periods(KnownRates(-math.inf, -math.inf, OTHER)) == [RatePeriod(30.0, 60.0, OTHER)]


def test_rates_outside_the_interval_do_not_count() -> None:
    found = periods(KnownRates(0.0, 30.0, OTHER), KnownRates(60.0, 60.0, OTHER))
    assert found == [RatePeriod(30.0, 60.0, COMMANDED)]


@pytest.mark.parametrize('shift', [-0.4, 0.4])
def test_clocks_that_differ_by_less_than_half_a_second_make_no_periods(shift: float) -> None:
    found = periods(KnownRates(30.0 + shift, 60.0 + shift, OTHER))
    assert found == [RatePeriod(30.0, 60.0, OTHER)]


def test_periods_of_equal_rates_are_one() -> None:
    assert periods(KnownRates(30.0, 45.0, OTHER), KnownRates(45.0, 60.0, OTHER)) == [
        RatePeriod(30.0, 60.0, OTHER)
    ]


def test_a_fluctuating_flow_meter_counts_by_its_mean() -> None:
    known = [KnownRates(30.0 + n, 31.0 + n, push(390.0 if n % 2 else 410.0)) for n in range(30)]
    assert len(known) > MOST_PERIODS
    (mean,) = periods(*known)
    assert (mean.start, mean.end) == (30.0, 60.0)
    assert mean.rates['push'].rate == pytest.approx(from_ml_h(400.0))


def test_the_latest_known_rates_began_last() -> None:
    known = [KnownRates(20.0, 20.0, OTHER), KnownRates(10.0, 10.0, BEFORE)]
    assert latest_known(known, 30.0) == OTHER
    assert latest_known(known, 15.0) == BEFORE
    assert latest_known(known, 5.0) is None


def test_rates_are_the_same_within_half_a_step_of_a_pump() -> None:
    assert same_rates(push(300.0), push(300.04))
    assert not same_rates(push(300.0), push(300.1))
    assert same_rates(push(0.0), {})
    water, stock = WellRate(1e-7, 0.0), WellRate(1e-7, 1.0)
    assert not same_rates({'push': water}, {'push': stock})
    assert same_rates({'push': WellRate(-1e-7, 0.0)}, {'push': WellRate(-1e-7, 1.0)})


def test_the_producer_balances_measured_rates() -> None:
    measured = {**push(300.0), 'injector': WellRate(1e-7, 1.0), 'producer': WellRate(-1.7e-7)}
    rates = balanced(measured, 'producer')
    assert net_rate(rates) == pytest.approx(0.0, abs=1e-20)
    assert (rates['push'], rates['injector']) == (measured['push'], measured['injector'])


def test_a_difference_is_described_in_ml_h() -> None:
    found = [RatePeriod(0.0, 30.0, OTHER)]
    assert describe_difference(found, COMMANDED) == 'push 400.0 instead of 300.0 ml/h'
    assert describe_difference([RatePeriod(0.0, 30.0, push(297.0))], COMMANDED) == ''
    assert describe_difference([RatePeriod(0.0, 30.0, push(290.0))], COMMANDED) != ''
    fluid = [RatePeriod(0.0, 30.0, {'push': WellRate(from_ml_h(300.0), 1.0)})]
    assert describe_difference(fluid, COMMANDED) == 'push with concentration 1 instead of 0'
