"""Tests of the announced pauses of fixed wells."""

from pathlib import Path

from porotwin_core.rig import load_rig
from porotwin_hub.fixed_pauses import NO_PAUSES, FixedPauses

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


def test_pauses_are_in_minutes_in_rig_yaml() -> None:
    assert RIG.control is not None
    assert FixedPauses.of(RIG) == NO_PAUSES
    injector = RIG.control.fixed['injector'].model_copy(update={'pauses_min': ((15.0, 20.0),)})
    control = RIG.control.model_copy(update={'fixed': {'injector': injector}})
    told = RIG.model_copy(update={'control': control})
    assert FixedPauses.of(told).of_wells == {'injector': ((900.0, 1200.0),)}
