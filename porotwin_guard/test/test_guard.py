"""Tests of the guard: every broken rule is refused, and every valid setpoint passes."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig
from porotwin_guard.guard import Guard, SetpointRequest

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
NOW = 1.7e9
"""A time since 1970 [s]."""

Rates = dict[str, WellRate]


def guard() -> Guard:
    return Guard(RIG, photo_interval=30.0)


def rates(control1: float = 100.0, **changed: float) -> Rates:
    """Return balanced rates with `control1` [ml/h], except for the `changed` ones [ml/h]."""
    ml_h = {
        'injector': 500.0,
        'producer': -500.0 - control1,
        'control1': control1,
        'control2': 0.0,
        'control3': 0.0,
        **changed,
    }
    return {
        name: WellRate(from_ml_h(rate), 1.0 if name == 'injector' else 0.0)
        for name, rate in ml_h.items()
    }


def request(sequence: int = 1, stamp: float = NOW - 2.0, **changed: Any) -> SetpointRequest:
    known = {'valid_until': stamp + 90.0, 'rates': rates(), 'hub': 'first'}
    return SetpointRequest(sequence, stamp, **{**known, **changed})


def refusal(subject: Guard, asked: SetpointRequest, now: float = NOW) -> str:
    with pytest.raises(InputError) as caught:
        subject.check(asked, now=now)
    return str(caught.value)


def passes(subject: Guard, asked: SetpointRequest, now: float = NOW) -> None:
    subject.check(asked, now=now)
    subject.take(asked, now=now)


def hand_set_guard() -> Guard:
    assert RIG.control is not None
    control = RIG.control.model_copy(
        update={'rate_step_ml_h': 5.0, 'min_rate_ml_h': 20.0, 'max_change_ml_h': 100.0}
    )
    return Guard(RIG.model_copy(update={'control': control}), photo_interval=30.0)


@pytest.mark.parametrize(
    ('wrong', 'line'),
    [
        (12.0, 'allows multiples of 5 ml/h'),
        (15.0, 'allows none below 20 ml/h'),
        (205.0, 'changes by 105 ml/h; rig.yaml allows 100 ml/h'),
    ],
)
def test_settings_that_pumps_cannot_take_are_refused(wrong: float, line: str) -> None:
    subject = hand_set_guard()
    passes(subject, request(), now=NOW)
    later = request(2, NOW - 1.0, rates=rates(control1=wrong))
    assert line in refusal(subject, later)


def test_changes_count_from_the_setpoint_that_the_pumps_took() -> None:
    subject = hand_set_guard()
    passes(subject, request(), now=NOW)
    refused_by_the_pumps = request(2, NOW - 1.0, rates=rates(control1=200.0))
    subject.check(refused_by_the_pumps, now=NOW)
    passes(subject, request(3, NOW - 0.5, rates=rates(control1=50.0)), now=NOW)


def test_changes_count_from_the_safe_rates_after_an_expiry() -> None:
    subject = hand_set_guard()
    passes(subject, request(), now=NOW)
    later = NOW + 200.0
    assert 'changes by 200 ml/h' in refusal(
        subject, request(2, later - 1.0, rates=rates(control1=200.0)), later
    )
    passes(subject, request(3, later - 1.0, rates=rates(control1=100.0)), now=later)


def test_wells_may_be_switched_off_at_once() -> None:
    subject = hand_set_guard()
    passes(subject, request(rates=rates(control1=400.0)), now=NOW)
    passes(subject, request(2, NOW - 1.0, rates=rates(control1=0.0)), now=NOW)


@pytest.mark.parametrize(
    ('wrong', 'line'),
    [
        (rates(control1=501.0), "'control1': 501 ml/h; rig.yaml allows 0 to 500"),
        (rates(control1=-1.0), "'control1': -1 ml/h; rig.yaml allows 0 to 500"),
        (rates(control1=1e300), "'control1': 1e+300 ml/h"),
        (rates(control1=100.05), "'control1': 100.05 ml/h; rig.yaml allows multiples of 0.1 ml/h"),
        (rates(injector=499.0), "'injector': 499 ml/h; rig.yaml allows 500 to 500"),
        (rates(producer=600.0), "'producer': 600 ml/h; rig.yaml allows -1000 to 0"),
        (rates(producer=-1000.0), '400 ml/h more is produced than injected'),
        (rates(control1=300.0, control2=300.0, producer=-1000.0), 'control wells inject 600'),
        ({**rates(), 'injector': WellRate(from_ml_h(500.0), 0.5)}, 'injects concentration 0.5'),
        ({**rates(), 'control1': WellRate(from_ml_h(100.0), 1.0)}, 'injects concentration 1'),
        ({**rates(), 'nowhere': WellRate()}, 'see nowhere'),
        ({k: v for k, v in rates().items() if k != 'control3'}, 'see control3'),
        ({}, 'it must name every well'),
    ],
)
def test_rates_that_break_a_limit_are_refused(wrong: Rates, line: str) -> None:
    assert line in refusal(guard(), request(rates=wrong))


@pytest.mark.parametrize(
    ('stamp', 'validity', 'line'),
    [
        (NOW - 91.0, 90.0, 'it expired 1.0 s ago'),
        (NOW - 3600.0, 90.0, 'it expired 3510.0 s ago'),
        (NOW + 31.0, 90.0, 'lies 31.0 s in the future'),
        (4e9, 90.0, 'in the future'),
        (NOW, 91.0, 'valid for 91 s; the guard allows up to 90 s'),
        (NOW, 1e12, 'valid for 1e+12 s'),
        (NOW, 0.0, 'valid for 0 s'),
        (NOW, -90.0, 'valid for -90 s'),
        (math.nan, 90.0, 'valid for nan s'),
        (30.0, 90.0, 'it expired'),
    ],
)
def test_setpoints_at_impossible_times_are_refused(
    stamp: float, validity: float, line: str
) -> None:
    assert line in refusal(guard(), request(stamp=stamp, valid_until=stamp + validity))


def test_numbers_count_up_until_another_hub_begins() -> None:
    subject = guard()
    passes(subject, request(7), now=NOW)
    for sequence in (7, 6, 0):
        asked = request(sequence, stamp=NOW + 28.0)
        assert 'does not follow 7' in refusal(subject, asked, NOW + 30.0)
    passes(subject, request(9, stamp=NOW + 28.0), now=NOW + 30.0)
    passes(subject, request(1, stamp=NOW + 58.0, hub='second'), now=NOW + 60.0)
    assert 'does not follow 1' in refusal(subject, request(1, NOW + 88.0, hub='second'), NOW + 90)


def test_an_older_photograph_cannot_end_a_setpoint_in_force() -> None:
    subject = guard()
    passes(subject, request(1, stamp=NOW), now=NOW)
    for hub in ('first', 'second'):
        asked = request(2, stamp=NOW - 10.0, hub=hub)
        assert 'no newer than the one of setpoint 1' in refusal(subject, asked, NOW + 5.0)
    # an hour later the clock of this machine was set back
    passes(subject, request(2, stamp=NOW - 3600.0), now=NOW - 3599.0)


def test_a_refused_setpoint_leaves_the_last_one_in_force() -> None:
    subject = guard()
    passes(subject, request(1), now=NOW)
    refusal(subject, request(2, stamp=NOW + 28.0, rates=rates(control1=900.0)), NOW + 30.0)
    assert subject.expired(NOW + 90.0) is None
    assert subject.expired(NOW + 91.0) == 1
    passes(subject, request(2, stamp=NOW + 98.0), now=NOW + 100.0)
    assert subject.expired(NOW + 101.0) is None


@pytest.mark.parametrize('lag', [3600.0, -3600.0, NOW])
def test_a_camera_with_another_clock_is_believed_once_its_pace_proves_it(lag: float) -> None:
    subject = guard()
    for number in range(3):
        now = NOW + 30.0 * number
        refusal(subject, request(number + 1, stamp=now - lag), now)
    passes(subject, request(4, stamp=NOW + 90.0 - lag), now=NOW + 93.0)
    passes(subject, request(5, stamp=NOW + 120.0 - lag), now=NOW + 121.0)
    assert 'it expired' in refusal(subject, request(6, stamp=NOW + 121.0 - lag), NOW + 300.0)


def test_a_backlog_of_old_photographs_proves_no_clock() -> None:
    subject = guard()
    for number in range(50):  # two photographs in the time of one
        now = NOW + 15.0 * number
        asked = request(number + 1, stamp=NOW - 3600.0 + 30.0 * number)
        assert 'it expired' in refusal(subject, asked, now)


def test_simulated_time_counts_from_the_start_of_the_experiment() -> None:
    subject = guard()
    passes(subject, request(1, stamp=0.0), now=0.0)
    passes(subject, request(2, stamp=30.0), now=0.0)  # the clock arrives a moment later
    passes(subject, request(3, stamp=60.0), now=61.0)
    assert 'it expired 10.0 s ago' in refusal(subject, request(4, stamp=61.0), 161.0)
    assert 'in the future' in refusal(subject, request(4, stamp=NOW), 161.0)
    assert 'in the future' in refusal(guard(), request(1, stamp=1800.0), 0.0)
    passes(subject, request(4, stamp=0.0), now=1.0)  # a replay begins again


def test_nothing_may_be_set_without_a_control_section() -> None:
    subject = Guard(RIG.model_copy(update={'control': None}), photo_interval=30.0)
    assert 'rig.yaml allows 0 to 0' in refusal(subject, request())
    still = {name: WellRate() for name in RIG.wells}
    passes(subject, request(rates=still), now=NOW)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=5, max_size=5))
def test_no_rates_beyond_the_limits_pass(ml_h: list[float]) -> None:
    asked = request(rates=rates(**dict(zip(RIG.wells, ml_h, strict=True))))
    try:
        guard().check(asked, now=NOW)
    except InputError:
        return
    values = {name: to_ml_h(well.rate) for name, well in asked.rates.items()}
    assert math.isclose(math.fsum(values.values()), 0.0, abs_tol=2e-3)
    assert all(-2e-3 <= values[name] <= 500.002 for name in ('control1', 'control2', 'control3'))


@given(st.floats(), st.floats())
def test_any_times_pass_or_are_refused_in_one_line(stamp: float, valid_until: float) -> None:
    asked = dataclasses.replace(request(), stamp=stamp, valid_until=valid_until)
    try:
        guard().check(asked, now=NOW)
    except InputError as error:
        assert '\n' not in str(error)
    else:
        assert valid_until >= NOW - 1e-6
        assert valid_until - stamp <= 90.0 + 1e-5


def test_a_pausing_well_may_rest_and_a_producer_takes_out_no_more_than_it_may() -> None:
    assert RIG.control is not None
    control = RIG.control.with_pauses({'injector': ((7.0, 14.0),)}, None)
    control = control.model_copy(update={'max_producer_rate_ml_h': 600.0})
    subject = Guard(RIG.model_copy(update={'control': control}), photo_interval=30.0)
    resting = rates(100.0, injector=0.0, producer=-100.0)
    subject.check(request(rates=resting), now=NOW)
    assert "well 'injector'" in refusal(guard(), request(rates=resting))
    half = rates(100.0, injector=250.0, producer=-350.0)
    assert "well 'injector'" in refusal(subject, request(rates=half))
    assert 'allows -600 to 0 ml/h' in refusal(subject, request(rates=rates(101.0)))


def test_a_producer_takes_out_more_while_a_well_that_takes_out_rests() -> None:
    assert RIG.control is not None
    fixed = dict(RIG.control.fixed)
    fixed['control3'] = type(fixed['injector'])(rate_ml_h=-200.0, pauses_min=((7.0, 14.0),))
    control = RIG.control.model_copy(update={'fixed': fixed, 'wells': ('control1', 'control2')})
    assert control.most_taken_ml_h == 1000.0
    subject = Guard(RIG.model_copy(update={'control': control}), photo_interval=30.0)
    subject.check(request(rates=rates(300.0, control2=200.0, producer=-1000.0)), now=NOW)
    most = rates(300.0, control2=200.0, control3=-200.0, producer=-800.0)
    subject.check(request(rates=most), now=NOW)
