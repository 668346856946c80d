"""Tests of proposed rates: their checks, and the plans made from them."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import load_rig
from porotwin_siblings.proposed_rates import (
    MOST_STEPS,
    check_balance,
    check_proposal,
    check_steps,
    concentration_note,
    proposed_plan,
)

RIG = load_rig(Path(__file__).resolve().parents[2] / 'rigs' / 'small' / 'rig.yaml')
FIRST = {'a': WellRate(1e-7), 'out': WellRate(-1e-7)}
SECOND = {'a': WellRate(2e-7), 'out': WellRate(-2e-7)}


def test_wells_that_a_proposal_leaves_out_keep_their_rates_and_the_producer_balances() -> None:
    steps, present = [RateStep(60.0, {'a': WellRate(3e-7)})], [RateStep(0.0, FIRST)]
    plan = proposed_plan(steps, present, 'out')
    assert plan[0] == present[0]
    assert plan[1].rates['out'].rate == pytest.approx(-3e-7)
    assert proposed_plan(steps, present, None)[1].rates['out'] == FIRST['out']
    named = [RateStep(0.0, {'a': WellRate(3e-7), 'out': WellRate(-1e-7)})]
    assert proposed_plan(named, present, 'out')[0].rates['out'].rate == -1e-7
    assert proposed_plan([], present, 'out') == tuple(present)
    later = [*steps, RateStep(90.0, {'out': WellRate(-2e-7)})]
    rates = [step.rates['out'].rate for step in proposed_plan(later, present, 'out')]
    assert rates == pytest.approx([-1e-7, -3e-7, -2e-7]), 'it balances until it is named'


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
        (-100.0, 300.0, 600.0, 'a change at -100 s after the state lies before the state'),
        (float('nan'), 300.0, 600.0, 'a change at nan s after the state'),
        (0.0, -300.0, 600.0, "'control1': -300 ml/h has the wrong sign"),
        (900.0, 300.0, 600.0, 'a change at 900 s after the state lies beyond the horizon of 600 s'),
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
    with pytest.raises(
        InputError, match=r'200 ml/h more is injected than produced from 60 s after'
    ):
        check_balance(plans[2], present, closed)
    with pytest.raises(InputError, match=r'produced from 1060 on'):
        check_balance(plans[2], present, closed, lambda after: f'{1000.0 + after:g}')


def test_another_concentration_than_that_of_rig_yaml_is_noted() -> None:
    usual = {'injector': WellRate(1e-7, 1.0), 'control1': WellRate(1e-7)}
    diluted = usual | {'injector': WellRate(1e-7, 0.3)}
    assert concentration_note([[RateStep(0.0, usual)]], RIG) == ''
    note = concentration_note([[RateStep(0.0, usual), RateStep(60.0, diluted)]], RIG)
    assert 'injector injects a concentration of 0.3 by the rates, 1 by rig.yaml' in note
    resting = {'injector': WellRate(0.0, 0.3)}
    assert concentration_note([[RateStep(0.0, resting)]], RIG) == ''
