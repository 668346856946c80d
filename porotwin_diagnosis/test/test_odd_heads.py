"""Oddities of the water levels beyond the open sides."""

from pathlib import Path

from porotwin_core.rig import Boundaries, EffectDescription, Rig, load_rig
from porotwin_diagnosis.data.odd_heads import odd_heads

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

HIGHER = EffectDescription(name='water_level', parameters={'left': 0.004})


def rig_with(boundaries: Boundaries) -> Rig:
    return load_rig(RIGS / 'small').model_copy(update={'boundaries': boundaries})


def test_a_level_that_makes_heads_jump_in_a_corner_is_told() -> None:
    rig = rig_with(Boundaries(top='open', left='open', right='open'))
    assert not odd_heads(rig)
    (line,) = odd_heads(rig.with_effects([HIGHER]))
    assert 'the top and the left side meet in a corner' in line
    assert '0.004 m apart' in line


def test_heads_that_differ_between_opposite_sides_are_not_odd() -> None:
    rig = rig_with(Boundaries(top='closed', left='open', right='open'))
    assert not odd_heads(rig.with_effects([HIGHER]))
