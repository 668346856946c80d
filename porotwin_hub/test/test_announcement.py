"""Setpoints in words: what changed is what is said."""

from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate
from porotwin_hub.announcement import announce

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


def test_a_difference_below_the_pumps_step_is_no_change() -> None:
    nearly = {**AFTER, 'control1': WellRate(from_ml_h(240.52))}
    assert announce(9, nearly, AFTER).changed == ()
