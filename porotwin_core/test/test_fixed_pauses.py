"""Tests of the announced pauses of fixed wells."""

from pathlib import Path

import pytest

from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.rate_periods import same_rates
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import RateStep, Schedule, ScheduleRow, WellRate, net_rate
from porotwin_core.rig import load_rig

RIG = load_rig(Path(__file__).resolve().parents[2] / 'rigs' / 'small' / 'rig.yaml')


def test_a_well_rests_from_the_start_of_a_pause_to_its_end() -> None:
    pauses = FixedPauses({'injector': ((900.0, 1200.0), (2100.0, 2400.0))})
    assert [pauses.resting(time) == {'injector'} for time in (0.0, 900.0, 1199.0, 1200.0)] == [
        False,
        True,
        True,
        False,
    ]
    assert pauses.moments(900.0, 2400.0) == {1200.0, 2100.0}


def test_a_well_of_many_cycles_rests_in_each() -> None:
    pauses = FixedPauses({'injector': tuple((60.0 * n, 60.0 * n + 30.0) for n in range(1, 9))})
    rests = [pauses.resting(30.0 * half) == {'injector'} for half in range(20)]
    assert rests == [half % 2 == 0 and 2 <= half <= 16 for half in range(20)]


def test_pauses_are_in_minutes_in_rig_yaml() -> None:
    assert RIG.control is not None
    assert FixedPauses.of(RIG) == NO_PAUSES
    injector = RIG.control.fixed['injector'].model_copy(update={'pauses_min': ((15.0, 20.0),)})
    control = RIG.control.model_copy(update={'fixed': {'injector': injector}})
    told = RIG.model_copy(update={'control': control})
    assert FixedPauses.of(told).of_wells == {'injector': ((900.0, 1200.0),)}


def paused(start_min: float, end_min: float) -> FixedPauses:
    """Return the pauses of the small rig with one of the injector."""
    assert RIG.control is not None
    pauses = ((start_min, end_min),)
    injector = RIG.control.fixed['injector'].model_copy(update={'pauses_min': pauses})
    control = RIG.control.model_copy(update={'fixed': {'injector': injector}})
    return FixedPauses.of(RIG.model_copy(update={'control': control}))


def test_rates_that_nobody_measured_follow_the_pauses() -> None:
    safe = safe_rates(RIG)
    pauses = paused(1.0, 2.0).since(1000.0)
    assert pauses.at(1059.0, safe) is safe
    resting = pauses.at(1060.0, safe)
    assert resting['injector'].rate == 0.0
    assert net_rate(resting) == pytest.approx(0.0, abs=1e-20)
    again = pauses.at(1120.0, resting)
    assert same_rates(again, safe)
    assert NO_PAUSES.at(1060.0, safe) is safe


def test_a_plan_is_divided_by_the_pauses() -> None:
    safe = safe_rates(RIG)
    other = {**safe, 'control1': WellRate(1e-8)}
    plan = paused(1.0, 2.0).in_plan([RateStep(0.0, safe), RateStep(90.0, other)], 30.0, 300.0)
    assert [step.start for step in plan] == [0.0, 30.0, 90.0]
    assert [step.rates['injector'].rate == 0.0 for step in plan] == [False, True, False]
    early = paused(1.0, 2.0).in_plan([RateStep(0.0, safe)], 30.0, 20.0)
    assert early == (RateStep(0.0, safe),)


def test_a_schedule_with_pauses_keeps_its_rests_and_its_end() -> None:
    stock, rest = WellRate(1e-7, 1.0), WellRate()
    pauses = FixedPauses({'a': ((60.0, 120.0),)}, {'a': stock}, 'out')
    rows = (
        (0.0, 'a', stock),
        (0.0, 'out', WellRate(-3e-8)),
        (180.0, 'a', rest),
        (300.0, 'a', rest),
    )
    run = pauses.in_schedule(Schedule(tuple(ScheduleRow(*row) for row in rows)))
    assert [run.at(time)['a'].rate for time in (0.0, 60.0, 120.0, 180.0)] == [1e-7, 0.0, 1e-7, 0.0]
    assert run.at(60.0)['out'].rate == 0.0  # a producer never injects
    assert run.rows[-1].time == 300.0
    assert pauses.in_schedule(run) == run


def test_a_well_that_rests_at_the_end_rests_on() -> None:
    assert RIG.control is not None
    control = RIG.control.with_pauses({'injector': ((15.0, 20.0), (50.0, 60.0))}, 60.0)
    pauses = FixedPauses.of(RIG.model_copy(update={'control': control})).since(100.0)
    assert [bool(pauses.resting(100.0 + 60.0 * minute)) for minute in (14, 16, 30, 59, 70)] == [
        False, True, False, True, True,
    ]  # fmt: skip
    assert pauses.moments(0.0, 1e9) == {1000.0, 1300.0, 3100.0}
