"""Tests of the operator's book of setpoints."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.operator.setpoint_book import SetpointBook, ShownSetpoint


@pytest.fixture
def limits(small_rig: Rig) -> Limits:
    return Limits.of(small_rig)


@pytest.fixture
def safe(limits: Limits) -> dict[str, WellRate]:
    return limits.safe()


@pytest.fixture
def other(limits: Limits) -> dict[str, WellRate]:
    return limits.setpoint(from_ml_h(1.0) * np.array([100.0, 0.0, 0.0]))


@pytest.fixture
def book(small_rig: Rig) -> SetpointBook:
    return SetpointBook(small_rig)


Rates = dict[str, WellRate]


def shown(sequence: int, rates: Rates, *, stamp: float, validity: float = 90.0) -> ShownSetpoint:
    return ShownSetpoint(sequence, rates, stamp, stamp + validity, validity)


def announced(book: SetpointBook, sequence: int, rates: Rates, *, now: float = 0.0) -> str:
    stamp = now or next(CLOCK)
    return book.announce(shown(sequence, rates, stamp=stamp), now=now).text


CLOCK = itertools.count(1.0)
"""Stamps of photographs: each is newer than the one before."""


def test_changes_are_announced_relative_to_the_last_setpoint(
    book: SetpointBook, safe: Rates, other: Rates
) -> None:
    for sequence, rates in ((1, other), (2, other), (3, safe)):
        announced(book, sequence, rates)
    assert '<-- was' not in announced(book, 4, safe)
    assert '<-- was 0.0' in announced(book, 5, other)


def test_the_reason_of_a_setpoint_is_shown(book: SetpointBook, safe: Rates) -> None:
    held = replace(shown(1, safe, stamp=next(CLOCK)), reason='held: the solver does not answer')
    lines = book.announce(held, now=0.0).text.splitlines()
    assert lines[1] == '  why: held: the solver does not answer'
    assert 'why' not in announced(book, 2, safe)  # an empty reason takes no line


def test_after_a_restart_of_the_hub_the_numbers_begin_again(
    book: SetpointBook, safe: Rates, other: Rates
) -> None:
    for sequence, rates in ((1, other), (2, other), (3, safe)):
        announced(book, sequence, rates)
    assert '<-- was' not in announced(book, 1, safe)
    assert '<-- was 0.0' in announced(book, 2, other)
    assert '<-- was' not in announced(book, 3, other)
    assert book.newest == 3


def test_a_setpoint_that_breaks_a_limit_is_refused(book: SetpointBook, safe: Rates) -> None:
    for wrong in (
        {**safe, 'control1': WellRate(from_ml_h(9e5))},
        {**safe, 'injector': WellRate(from_ml_h(500.0), 0.0)},
        {**safe, 'nowhere': WellRate(1e-9)},
    ):
        with pytest.raises(InputError):
            announced(book, 1, wrong)
    assert book.newest is None


def test_an_expired_setpoint_is_announced_once_and_stands_for_the_safe_rates(
    book: SetpointBook, safe: Rates, other: Rates
) -> None:
    announced(book, 1, other, now=1000.0)
    assert book.expire(1089.0) is None
    words = book.expire(1091.0)
    assert words is not None
    assert book.expire(1092.0) is None
    assert words.text.count('setpoint 1 has expired') == 1
    assert '0.0 ml/h   <-- was 100.0' in words.text
    assert words.changed == tuple(safe)
    with pytest.raises(InputError, match='has expired, and the safe rates took its place'):
        book.confirmed(1, {})
    assert book.confirmed(1, {}) == safe
    assert '<-- was 0.0' in announced(book, 2, other, now=1093.0)


def test_confirmed_rates_are_the_announced_ones_except_for_changes(
    book: SetpointBook, other: Rates
) -> None:
    announced(book, 1, other)
    changed = {
        'control2': WellRate(from_ml_h(40.0)),
        'producer': WellRate(from_ml_h(-640.0)),
    }
    assert book.confirmed(1, {}) == other
    assert book.confirmed(1, changed) == {**other, **changed}


def test_a_rate_that_the_operator_did_not_set_is_told_again(
    book: SetpointBook, other: Rates
) -> None:
    announced(book, 1, other)
    less = {'control1': WellRate(from_ml_h(40.0)), 'producer': WellRate(from_ml_h(-540.0))}
    book.confirmed(1, less)
    assert '100.0 ml/h   <-- was 40.0' in announced(book, 2, other)
    book.confirmed(2, {})
    assert '<--' not in announced(book, 3, other)


def test_an_unknown_setpoint_or_well_cannot_be_confirmed(book: SetpointBook, other: Rates) -> None:
    with pytest.raises(InputError, match='setpoint 1 is not known; there was none yet'):
        book.confirmed(1, {})
    announced(book, 1, other)
    with pytest.raises(InputError, match='9 is not the newest; set and confirm setpoint 1'):
        book.confirmed(9, {})
    with pytest.raises(InputError, match="well 'nowhere' is not in the rig"):
        book.confirmed(1, {'nowhere': WellRate(1e-9)})


def test_only_the_newest_setpoint_is_confirmed(
    book: SetpointBook, safe: Rates, other: Rates
) -> None:
    announced(book, 1, safe)
    announced(book, 2, other)
    with pytest.raises(InputError, match='1 is not the newest; set and confirm setpoint 2'):
        book.confirmed(1, {})
    assert book.confirmed(2, {}) == other


def test_rates_that_do_not_balance_are_confirmed_only_after_a_question(
    book: SetpointBook, other: Rates
) -> None:
    announced(book, 1, other)
    changed = {'control2': WellRate(from_ml_h(350.0))}
    with pytest.raises(InputError, match=r'350 ml/h more is injected than produced; is producer'):
        book.confirmed(1, changed)
    with pytest.raises(InputError, match=r'340 ml/h more is injected'):
        book.confirmed(1, {'control2': WellRate(from_ml_h(340.0))})
    with pytest.raises(InputError, match=r'350 ml/h more is injected'):
        book.confirmed(1, changed)
    assert book.confirmed(1, changed) == {**other, **changed}


def test_rates_that_no_pump_can_run_at_are_never_confirmed(
    book: SetpointBook, other: Rates
) -> None:
    announced(book, 1, other)
    for rate_ml_h in (1e300, -1e9):
        for _ in range(2):
            with pytest.raises(InputError, match="'injector'"):
                book.confirmed(1, {'injector': WellRate(from_ml_h(rate_ml_h), 1.0)})


def test_an_expired_setpoint_or_an_older_photograph_is_not_announced(
    book: SetpointBook, safe: Rates, other: Rates
) -> None:
    with pytest.raises(InputError, match='it expired at 0:00:50'):
        book.announce(shown(1, other, stamp=60.0, validity=-10.0), now=100.0)
    book.announce(shown(1, other, stamp=60.0), now=100.0)
    with pytest.raises(InputError, match='no newer than the one of setpoint 1'):
        book.announce(shown(2, safe, stamp=30.0), now=101.0)
    assert book.newest == 1
    assert book.expire(200.0) is not None
    book.announce(shown(2, safe, stamp=30.0), now=201.0)


def test_small_changes_add_up_until_a_hand_can_set_them(book: SetpointBook, limits: Limits) -> None:
    texts = [
        announced(book, number, limits.setpoint(from_ml_h(1.0) * np.array([rate, 0.0, 0.0])))
        for number, rate in ((1, 100.0), (2, 100.6), (3, 101.2))
    ]
    assert '<--' not in texts[1]
    assert '101.2 ml/h   <-- was 100.0' in texts[2]


def test_safe_rates_have_the_announced_pauses(small_rig: Rig) -> None:
    assert small_rig.control is not None
    control = small_rig.control.with_pauses({'injector': ((1.0, 4.0),)}, None)
    book = SetpointBook(small_rig.model_copy(update={'control': control}))
    book.began = 1000.0
    usual = Limits.of(small_rig).safe()
    book.announce(shown(5, usual, stamp=1000.0), now=50.0)  # the clocks differ by 950 s
    assert book.expire(139.0) is None
    paused = book.expire(141.0)
    assert paused is not None
    assert 'Switch injector off.' in paused.speech
    with pytest.raises(InputError, match='has expired'):
        book.confirmed(5, {})
    assert book.confirmed(5, {})['injector'].rate == 0.0
    assert book.expire(200.0) is None
    resumed = book.expire(291.0)
    assert resumed is not None
    assert 'Set injector to 500.' in resumed.speech
    assert 'An announced pause begins or ends.' in resumed.speech


def test_before_the_start_is_known_the_pauses_of_the_first_minute_hold(small_rig: Rig) -> None:
    assert small_rig.control is not None
    control = small_rig.control.with_pauses({'injector': ((0.0, 4.0),)}, None)
    book = SetpointBook(small_rig.model_copy(update={'control': control}))
    book.announce(shown(5, Limits.of(small_rig).safe(), stamp=1000.0), now=50.0)
    paused = book.expire(141.0)
    assert paused is not None
    assert 'Switch producer off.' in paused.speech
