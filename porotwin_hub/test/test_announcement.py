"""Tests of setpoints in words: changes are marked and spoken."""

import re

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_hub.operator.announcement import (
    announce,
    announce_expiry,
    clock_time,
    confirmation_in_words,
)

BEFORE = {'control1': WellRate(from_ml_h(120.0)), 'producer': WellRate(from_ml_h(-620.0))}
AFTER = {'control1': WellRate(from_ml_h(240.5)), 'producer': WellRate(from_ml_h(-740.5))}


def test_every_rate_is_shown_in_ml_h_and_changes_are_marked() -> None:
    words = announce(7, AFTER, BEFORE)
    assert words.text.splitlines()[0] == 'setpoint 7'
    assert '240.5 ml/h   <-- was 120.0' in words.text
    assert words.changed == ('control1', 'producer')


def test_speech_names_only_what_changed() -> None:
    speech = announce(7, AFTER, BEFORE).speech
    assert speech == 'Set control 1 to 240.5. Set producer to minus 740.5.'
    same = announce(8, AFTER, AFTER)
    assert (same.speech, same.changed) == ('No change.', ())


def test_a_well_whose_rate_is_unknown_is_always_announced() -> None:
    words = announce(1, {**AFTER, 'control2': WellRate()}, AFTER)
    assert words.changed == ('control2',)
    assert words.text.endswith('0.0 ml/h   <-- set')
    assert words.speech == 'Switch control 2 off.'


def test_a_change_below_what_a_hand_can_set_is_not_marked() -> None:
    nearly = {**AFTER, 'control1': WellRate(from_ml_h(241.4))}
    assert announce(9, nearly, AFTER, same=from_ml_h(0.95)).changed == ()
    enough = {**AFTER, 'control1': WellRate(from_ml_h(241.5))}
    assert announce(9, enough, AFTER, same=from_ml_h(0.95)).changed == ('control1',)


def test_an_expired_setpoint_is_announced_with_the_safe_rates_of_every_well() -> None:
    safe = {**BEFORE, 'control2': WellRate()}
    words = announce_expiry(7, safe, {**AFTER, 'control2': WellRate()})
    assert words.text.splitlines()[0].startswith('setpoint 7 has expired')
    assert words.speech == (
        'Setpoint 7 has expired. Set the safe rates now. '
        'Set control 1 to 120. Set producer to minus 620. Switch control 2 off.'
    )
    assert words.changed == ('control1', 'producer', 'control2')
    assert words.text.count('<--') == 3
    assert words.text.endswith('0.0 ml/h   <-- set')  # it was off before: no "was 0.0"


def test_times_are_times_of_the_day_or_of_the_experiment() -> None:
    assert clock_time(3723.4) == '1:02:03'
    assert re.fullmatch(r'\d\d:\d\d:\d\d', clock_time(1.7e9))


def test_a_confirmation_names_its_sender_and_what_differs() -> None:
    line = confirmation_in_words(23, {'barrier1': WellRate(from_ml_h(170.0))}, '/rig/\x1b[2Jpage')
    assert line == (
        r'confirmed by /rig/\x1b[2Jpage: setpoint 23 is set, but barrier1 at 170.0 ml/h'
    )
    assert confirmation_in_words(4, {}, '/page') == 'confirmed by /page: setpoint 4 is set'


def test_a_pump_of_fine_steps_is_told_exactly() -> None:
    rates = {name: WellRate(from_ml_h(rate)) for name, rate in (('a', 12.25), ('b', 0.04))}
    words = announce(1, rates, {})
    assert words.speech == 'Set a to 12.25. Set b to 0.04.'
    assert ' 12.25 ml/h' in words.text
