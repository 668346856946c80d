"""Tests of setpoints in words: changes are marked and spoken."""

from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate
from porotwin_hub.announcement import announce, announce_expiry

BEFORE = {'control1': WellRate(from_ml_h(120.0)), 'producer': WellRate(from_ml_h(-620.0))}
AFTER = {'control1': WellRate(from_ml_h(240.5)), 'producer': WellRate(from_ml_h(-740.5))}


def test_every_rate_is_shown_in_ml_h_and_changes_are_marked() -> None:
    words = announce(7, AFTER, BEFORE)
    assert words.text.splitlines()[0] == 'setpoint 7'
    assert '240.5 ml/h   <-- was 120.0' in words.text
    assert words.changed == ('control1', 'producer')


def test_speech_names_only_what_changed() -> None:
    assert announce(7, AFTER, BEFORE).speech == 'Set control 1: 240, producer: minus 740.'
    same = announce(8, AFTER, AFTER)
    assert (same.speech, same.changed) == ('No change.', ())


def test_a_well_whose_rate_is_unknown_is_always_announced() -> None:
    words = announce(1, {**AFTER, 'control2': WellRate()}, AFTER)
    assert words.changed == ('control2',)
    assert words.text.endswith('0.0 ml/h   <-- set')
    assert words.speech == 'Set control 2: 0.'


def test_a_difference_below_the_pumps_step_is_no_change() -> None:
    nearly = {**AFTER, 'control1': WellRate(from_ml_h(240.52))}
    assert announce(9, nearly, AFTER).changed == ()


def test_an_expired_setpoint_is_announced_with_the_safe_rates() -> None:
    words = announce_expiry(7, BEFORE, AFTER)
    assert words.text.splitlines()[0].startswith('setpoint 7 has expired')
    assert words.speech == 'Setpoint 7 has expired. Set control 1: 120, producer: minus 620.'
    assert words.changed == ('control1', 'producer')
