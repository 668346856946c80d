"""Tests of the log of rates, and of plans made from proposals."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rates_in_force import KnownRates, RatePeriod
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import RateStep, WellRate, WellRates
from porotwin_core.rig import load_rig
from porotwin_siblings.rate_log import (
    MOST_STEPS,
    RateLog,
    check_balance,
    check_proposal,
    check_roles,
    check_steps,
    concentration_note,
    plan_periods,
    proposed_plan,
)

RIG = load_rig(Path(__file__).resolve().parents[2] / 'rigs' / 'small' / 'rig.yaml')
REST = {'a': WellRate(), 'out': WellRate()}
FIRST = {'a': WellRate(1e-7), 'out': WellRate(-1e-7)}
SECOND = {'a': WellRate(2e-7), 'out': WellRate(-2e-7)}


def first_of(log: RateLog, time: float) -> WellRates:
    """Return the rates that hold at `time` [s] and from then on."""
    (step,) = log.present_plan(time, 300.0)
    assert step.start == 0.0
    return step.rates


def test_setpoints_hold_from_their_photograph_on() -> None:
    log = RateLog(REST)
    log.add_commanded(30.0, FIRST)
    log.add_commanded(60.0, SECOND)
    assert log.take(0.0, 90.0) == (
        RatePeriod(0.0, 30.0, REST),
        RatePeriod(30.0, 60.0, FIRST),
        RatePeriod(60.0, 90.0, SECOND),
    )
    assert log.take(90.0, 120.0) == (RatePeriod(90.0, 120.0, SECOND),)


def test_known_rates_replace_commanded_ones() -> None:
    log = RateLog(REST)
    log.add_commanded(0.0, FIRST)
    log.add_known(KnownRates(0.0, 20.0, SECOND))
    assert log.take(0.0, 30.0) == (RatePeriod(0.0, 20.0, SECOND), RatePeriod(20.0, 30.0, FIRST))


def test_confirmed_rates_are_present_until_a_newer_setpoint() -> None:
    log = RateLog(REST)
    log.add_commanded(0.0, FIRST)
    log.add_known(KnownRates(10.0, 10.0, SECOND))
    assert first_of(log, 20.0) == SECOND
    log.add_commanded(30.0, FIRST)
    assert first_of(log, 30.0) == FIRST
    assert log.is_commanded(30.0)
    assert not log.is_commanded(60.0)


def test_a_setpoint_that_follows_its_photograph_replaces_the_last_one() -> None:
    log = RateLog(REST)
    log.add_commanded(0.0, FIRST)
    assert log.take(0.0, 30.0) == (RatePeriod(0.0, 30.0, FIRST),)
    assert not log.is_commanded(30.0)
    log.add_commanded(30.0, SECOND)
    assert log.is_commanded(30.0)
    assert first_of(log, 30.0) == SECOND
    assert log.take(30.0, 60.0) == (RatePeriod(30.0, 60.0, SECOND),)
    log.add_commanded(60.0, SECOND)
    log.add_commanded(60.0, FIRST)  # sent again
    assert log.take(60.0, 90.0) == (RatePeriod(60.0, 90.0, FIRST),)


def test_confirmed_rates_hold_until_the_next_setpoint_only() -> None:
    log = RateLog(REST)
    log.add_commanded(0.0, FIRST)
    log.add_known(KnownRates(10.0, 10.0, REST))
    assert log.take(0.0, 30.0)[-1] == RatePeriod(0.0, 30.0, REST)
    log.add_commanded(30.0, SECOND)
    assert log.take(30.0, 60.0) == (RatePeriod(30.0, 60.0, SECOND),)


def test_rates_confirmed_at_the_very_time_of_a_setpoint_hold() -> None:
    log = RateLog(REST)
    log.add_commanded(30.0, FIRST)
    log.add_known(KnownRates(30.0, 30.0, SECOND))
    assert first_of(log, 30.0) == SECOND
    assert log.take(30.0, 60.0) == (RatePeriod(30.0, 60.0, SECOND),)


def test_a_person_who_told_when_orders_were_set_is_waited_for() -> None:
    log = RateLog(REST, wells=('a',))
    log.add_commanded(0.0, FIRST)
    log.add_known(KnownRates(100.0, 100.0, FIRST))
    log.take(0.0, 120.0)
    log.add_commanded(120.0, SECOND)
    # half of the delay so far, as the hub expects it
    assert log.present_plan(120.0, 300.0) == (RateStep(0.0, FIRST), RateStep(50.0, SECOND))
    assert log.take(120.0, 150.0) == (RatePeriod(120.0, 150.0, FIRST),)
    assert log.present_plan(150.0, 300.0) == (RateStep(0.0, FIRST), RateStep(20.0, SECOND))
    log.add_known(KnownRates(160.0, 160.0, SECOND))
    assert first_of(log, 160.0) == SECOND
    assert log.take(150.0, 180.0) == (
        RatePeriod(150.0, 160.0, FIRST),
        RatePeriod(160.0, 180.0, SECOND),
    )


def test_the_setpoints_of_pumps_that_follow_at_once_are_present_at_once() -> None:
    log = RateLog(REST, wells=('a',))
    log.add_commanded(0.0, FIRST)
    log.add_known(KnownRates(2.0, 30.0, FIRST))  # the pumps tell what they deliver
    log.take(0.0, 30.0)
    log.add_commanded(30.0, SECOND)
    assert first_of(log, 30.0) == SECOND
    log.add_known(KnownRates(32.0, 60.0, SECOND))
    assert log.take(30.0, 60.0)[-1] == RatePeriod(30.0, 60.0, SECOND)


def test_a_clock_that_goes_back_leaves_no_later_rates() -> None:
    log = RateLog(REST)
    log.add_commanded(500.0, FIRST)
    log.take(500.0, 530.0)
    log.forget_later(10.0)
    assert log.take(10.0, 40.0) == (RatePeriod(10.0, 40.0, FIRST),)
    log.add_commanded(40.0, SECOND)
    assert log.take(40.0, 600.0) == (RatePeriod(40.0, 600.0, SECOND),)


def test_an_announced_pause_holds_where_nothing_is_measured() -> None:
    log = RateLog(FIRST)
    log.pauses = FixedPauses({'a': ((60.0, 120.0),)}, {'a': FIRST['a']}, 'out')
    assert log.present_plan(30.0, 300.0) == (
        RateStep(0.0, FIRST),
        RateStep(30.0, REST),
        RateStep(90.0, FIRST),
    )
    log.add_known(KnownRates(90.0, 150.0, SECOND))
    assert log.take(0.0, 150.0) == (
        RatePeriod(0.0, 60.0, FIRST),
        RatePeriod(60.0, 90.0, REST),
        RatePeriod(90.0, 150.0, SECOND),
    )


def test_a_plan_ends_at_its_horizon() -> None:
    plan = [RateStep(0.0, FIRST), RateStep(50.0, SECOND), RateStep(500.0, REST)]
    assert plan_periods(plan, 1000.0, 100.0) == (
        RatePeriod(1000.0, 1050.0, FIRST),
        RatePeriod(1050.0, 1100.0, SECOND),
    )
    with pytest.raises(InputError, match='must begin at 0 s'):
        plan_periods(plan[1:], 0.0, 100.0)


def test_wells_that_a_proposal_leaves_out_keep_their_rates_and_the_producer_balances() -> None:
    steps, present = [RateStep(60.0, {'a': WellRate(3e-7)})], [RateStep(0.0, FIRST)]
    plan = proposed_plan(steps, present, 'out')
    assert plan[0] == present[0]
    assert plan[1].rates['out'].rate == pytest.approx(-3e-7)
    assert proposed_plan(steps, present, None)[1].rates['out'] == FIRST['out']
    named = [RateStep(0.0, {'a': WellRate(3e-7), 'out': WellRate(-1e-7)})]
    assert proposed_plan(named, present, 'out')[0].rates['out'].rate == -1e-7
    assert proposed_plan([], present, 'out') == tuple(present)


def test_wells_that_a_proposal_leaves_out_follow_the_present_plan() -> None:
    present = [RateStep(0.0, FIRST), RateStep(50.0, SECOND)]
    same = [RateStep(20.0, {'a': FIRST['a']})]
    assert proposed_plan(same, present, 'out') == (RateStep(0.0, FIRST),)
    free = [RateStep(20.0, {'b': WellRate(1e-7)})]
    assert proposed_plan(free, present, None)[-1].rates == {**SECOND, 'b': WellRate(1e-7)}


@pytest.mark.parametrize(
    ('start', 'rate_ml_h', 'horizon', 'complaint'),
    [
        (0.0, 1e9, 600.0, "well 'control1': 1e\\+09 ml/h is not plausible"),
        (0.0, 300.0, 1e9, 'horizon 1e\\+09 s: must be above 0 and at most 86400 s'),
        (0.0, 300.0, 0.0, 'horizon 0 s'),
        (-100.0, 300.0, 600.0, 'a change -100 s after the state lies before the state'),
        (float('nan'), 300.0, 600.0, 'a change nan s after the state'),
        (900.0, 300.0, 600.0, 'a change 900 s after the state lies beyond the horizon of 600 s'),
    ],
)
def test_a_proposal_without_end_is_refused(
    start: float, rate_ml_h: float, horizon: float, complaint: str
) -> None:
    step = RateStep(start, {'control1': WellRate(from_ml_h(rate_ml_h))})
    with pytest.raises(InputError, match=complaint):
        check_proposal([step], horizon, RIG)
    check_proposal([RateStep(0.0, {'control1': WellRate(from_ml_h(500.0))})], 600.0, RIG)


def test_a_question_has_few_steps_at_times_that_increase() -> None:
    check_steps([RateStep(1.0 * number, FIRST) for number in range(MOST_STEPS)])
    with pytest.raises(InputError, match='101 changes are more than the 100'):
        check_steps([RateStep(1.0 * number, FIRST) for number in range(MOST_STEPS + 1)])
    for second in (100.0, 50.0):
        with pytest.raises(InputError, match='at 100 s; give times that increase'):
            check_steps([RateStep(100.0, FIRST), RateStep(second, SECOND)])


@pytest.mark.parametrize(
    ('well', 'rate_ml_h', 'complaint'),
    [
        ('control1', -300.0, "'control1' at -300 ml/h: a control well only injects"),
        ('producer', 500.0, "'producer' at 500 ml/h: the producer never injects"),
    ],
)
def test_no_pump_runs_backwards(well: str, rate_ml_h: float, complaint: str) -> None:
    check_roles([RateStep(0.0, {well: WellRate(from_ml_h(-rate_ml_h))})], RIG)
    with pytest.raises(InputError, match=complaint):
        check_roles([RateStep(0.0, {well: WellRate(from_ml_h(rate_ml_h))})], RIG)


def test_a_closed_rig_refuses_rates_that_do_not_balance() -> None:
    sides = dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    closed = RIG.model_copy(update={'boundaries': RIG.boundaries.model_copy(update=sides)})
    present = [RateStep(0.0, safe_rates(RIG))]
    plans = [
        proposed_plan([RateStep(60.0, {well: WellRate(from_ml_h(rate))})], present, 'producer')
        for well, rate in (('control1', 200.0), ('producer', -497.0), ('producer', -300.0))
    ]
    for plan in plans[:2]:
        check_balance(plan, present, closed)
    check_balance(plans[2], present, RIG)
    check_balance(plans[2], plans[2], closed)
    with pytest.raises(InputError, match=r'200 ml/h more is injected than produced from 1 min'):
        check_balance(plans[2], present, closed)


def test_another_concentration_than_that_of_rig_yaml_is_noted() -> None:
    usual = {'injector': WellRate(1e-7, 1.0), 'control1': WellRate(1e-7)}
    diluted = usual | {'injector': WellRate(1e-7, 0.3)}
    assert concentration_note([[RateStep(0.0, usual)]], RIG) == ''
    note = concentration_note([[RateStep(0.0, usual), RateStep(60.0, diluted)]], RIG)
    assert 'injector injects a concentration of 0.3 by the rates, 1 by rig.yaml' in note
    resting = {'injector': WellRate(0.0, 0.3)}
    assert concentration_note([[RateStep(0.0, resting)]], RIG) == ''


@pytest.mark.parametrize('horizon', [0.0, float('nan'), float('inf')])
def test_a_forecast_needs_a_horizon(horizon: float) -> None:
    with pytest.raises(InputError, match='give a finite time above 0 s'):
        plan_periods([RateStep(0.0, {})], 0.0, horizon)
