"""Tests of the effects that a virtual rig hides from its twin."""

import pytest

from porotwin_cli.running.hidden_effect import MENDABLE, as_text, hidden_effect
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_rig.effects import parse_effects

RIG = load_rig(small_rig())


def test_a_surprise_follows_from_the_seed_and_can_be_mended() -> None:
    first = hidden_effect('surprise', RIG, seed=8)
    assert first == hidden_effect('surprise', RIG, seed=8)
    assert first.name in MENDABLE
    assert len({hidden_effect('surprise', RIG, seed=seed).name for seed in range(5)}) > 1


def test_an_effect_reaches_the_virtual_rig_as_text() -> None:
    found = hidden_effect('leak', RIG, seed=7)
    assert parse_effects(as_text(found)) == (found,)
    given = hidden_effect('rate:well=injector,factor=0.8', RIG, seed=7)
    assert given.parameters == {'well': 'injector', 'factor': 0.8}


def test_a_place_outside_the_rig_is_refused_before_the_demo_begins() -> None:
    with pytest.raises(InputError, match='lies outside the rig'):
        hidden_effect('leak:x=1.2,z=0.9,rate=1', RIG, seed=7)


@pytest.mark.parametrize('text', ['gravity', 'clock', 'gravity:g=3', 'clock:offset=3'])
def test_an_effect_that_a_live_rig_cannot_have_is_refused(text: str) -> None:
    with pytest.raises(InputError, match='hidden effect'):
        hidden_effect(text, RIG, seed=7)
