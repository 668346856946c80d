"""Stored recordings: their draw, their simulations, and the diagnosis with changed numbers."""

import importlib
import sys

import numpy as np
import pytest

from lab.blind.blind_effects import equal_names
from lab.blind.simulation_store import SimulationStore
from lab.stored.changed_numbers import PACKAGE, deciding_numbers, load_afresh
from lab.stored.stored_cases import StoredVerdict, is_held_out
from lab.stored.stored_draw import KINDS, WEAK, WEAK_SHARE, draw_stored, weakened
from porotwin_core.rig import EffectDescription


def test_recordings_are_drawn_reproducibly_of_both_rigs_and_every_kind():
    drawn = [draw_stored(number, 7) for number in range(2 * len(KINDS))]
    assert drawn[5].effects == draw_stored(5, 7).effects
    assert {case.kind for case in drawn} == {*KINDS}
    assert {case.rig.name for case in drawn} == {'small', 'two sands'}
    for kind in KINDS:
        numbers = [n for n in range(12 * len(KINDS)) if KINDS[n % len(KINDS)] == kind]
        assert {is_held_out(number) for number in numbers} == {True, False}
    for case in drawn:
        if case.kind in ('single', WEAK):
            assert case.right == equal_names(case.effects[0])


def test_a_weak_effect_keeps_its_place_and_has_a_share_of_its_strength():
    leak = EffectDescription(name='leak', parameters={'x': 0.1, 'z': 0.2, 'rate': 40.0})
    assert weakened(leak).parameters == {'x': 0.1, 'z': 0.2, 'rate': WEAK_SHARE * 40.0}
    rate = EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 1.2})
    assert weakened(rate).parameters['factor'] == pytest.approx(1.0 + WEAK_SHARE * 0.2)


def maps_of(value, *, frames):
    return np.full((frames, 2, 3), value)


def test_a_simulation_is_made_once_and_read_as_it_was_returned(tmp_path):
    store = SimulationStore(tmp_path / 'simulations')
    first = store.submit(maps_of, 0.123456789, frames=2).result()
    again = store.submit(maps_of, 0.123456789, frames=2).result()
    other = store.submit(maps_of, 0.123456789, frames=1).result()
    assert (store.made, store.found) == (2, 1)
    assert np.array_equal(first, again)
    assert other.shape == (1, 2, 3)
    assert first == pytest.approx(0.123456789, abs=1e-5)


@pytest.fixture
def loaded_again():
    """Restore the package as it was loaded, for the tests that follow."""
    known = {name: module for name, module in sys.modules.items() if name.split('.')[0] == PACKAGE}
    yield
    for name in [one for one in sys.modules if one.split('.')[0] == PACKAGE]:
        del sys.modules[name]
    sys.modules.update(known)


@pytest.mark.usefixtures('loaded_again')
def test_changed_numbers_reach_defaults_of_other_modules_until_the_next_loading():
    value = next(n.value for n in deciding_numbers() if n.name == 'SMOOTHING_WIDTH')
    for changes, expected in (({'SMOOTHING_WIDTH': '0.123'}, 0.123), ({}, value)):
        load_afresh(changes)
        forward = importlib.import_module(f'{PACKAGE}.model.forward')
        assert forward.whitened_residuals.__kwdefaults__['width'] == expected


def verdict(name, confidence, *, right=('decay',), listed=()):
    return StoredVerdict(
        name='case_000',
        kind='single',
        truth=('decay',),
        right=right,
        verdict=name,
        members=(name,),
        listed=listed,
        confidence=confidence,
        doubt='rival',
        simulations=1,
        seconds=1.0,
    )


def test_a_verdict_is_sure_and_wrong_only_with_a_wrong_name():
    assert verdict('decay', 0.9).is_right
    assert verdict('depth', 0.9, listed=('decay',)).is_right
    assert verdict('depth', 0.9).is_sure_and_wrong
    assert not verdict('depth', 0.6).is_sure_and_wrong
    assert not verdict('unexplained', 0.9).is_sure_and_wrong
    assert verdict('decay', 0.9).has_all
