"""Tests of the rates in force: measured, confirmed, or as commanded."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.rate_periods import (
    MOST_PERIODS,
    RatePeriod,
    balanced,
    describe_difference,
    plan_periods,
    same_rates,
    to_predict,
)
from porotwin_core.rates.wells import RateStep, WellRate, net_rate


def push(rate_ml_h: float) -> dict[str, WellRate]:
    return {'push': WellRate(from_ml_h(rate_ml_h))}


SLOW, FAST = push(300.0), push(400.0)


@pytest.mark.parametrize('shift', [-0.4, 0.4])
def test_clocks_that_differ_by_less_than_half_a_second_make_no_periods(shift: float) -> None:
    edge = 30.0 + shift if shift > 0.0 else 60.0 + shift
    found = to_predict([RatePeriod(30.0, edge, SLOW), RatePeriod(edge, 60.0, FAST)])
    assert found == (RatePeriod(30.0, 60.0, FAST if shift > 0.0 else SLOW),)


def test_periods_of_equal_rates_are_one() -> None:
    assert to_predict([RatePeriod(30.0, 45.0, FAST), RatePeriod(45.0, 60.0, FAST)]) == (
        RatePeriod(30.0, 60.0, FAST),
    )


def test_a_fluctuating_flow_meter_counts_by_its_mean() -> None:
    told = [RatePeriod(30.0 + n, 31.0 + n, push(390.0 if n % 2 else 410.0)) for n in range(30)]
    assert len(told) > MOST_PERIODS
    (mean,) = to_predict(told)
    assert (mean.start, mean.end) == (30.0, 60.0)
    assert mean.rates['push'].rate == pytest.approx(from_ml_h(400.0))


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
    found = [RatePeriod(0.0, 30.0, FAST)]
    assert describe_difference(found, SLOW) == 'push 400.0 instead of 300.0 ml/h'
    assert describe_difference([RatePeriod(0.0, 30.0, push(297.0))], SLOW) == ''
    assert describe_difference([RatePeriod(0.0, 30.0, push(290.0))], SLOW) != ''
    fluid = [RatePeriod(0.0, 30.0, {'push': WellRate(from_ml_h(300.0), 1.0)})]
    assert describe_difference(fluid, SLOW) == 'push with concentration 1 instead of 0'


def test_a_plan_ends_at_its_horizon() -> None:
    plan = [RateStep(0.0, SLOW), RateStep(50.0, FAST), RateStep(500.0, {})]
    assert plan_periods(plan, 1000.0, 100.0) == (
        RatePeriod(1000.0, 1050.0, SLOW),
        RatePeriod(1050.0, 1100.0, FAST),
    )
    with pytest.raises(InputError, match='must begin at 0 s'):
        plan_periods(plan[1:], 0.0, 100.0)


@pytest.mark.parametrize('horizon', [0.0, float('nan'), float('inf')])
def test_a_forecast_needs_a_horizon(horizon: float) -> None:
    with pytest.raises(InputError, match='give a finite time above 0 s'):
        plan_periods([RateStep(0.0, {})], 0.0, horizon)
