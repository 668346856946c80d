"""Solver and virtual rig have the same effects, although they are written independently."""

import pytest

from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_solver.effects import EFFECTS as SOLVER_EFFECTS
from porotwin_solver.effects.definition.effect import Scope

SHARED = [name for name in SOLVER_EFFECTS if name in RIG_EFFECTS]


def test_the_virtual_rig_has_every_effect_that_the_blind_check_draws() -> None:
    drawn = {name for name, effect in SOLVER_EFFECTS.items() if effect.blind_draw is not None}
    assert drawn <= RIG_EFFECTS.keys()
    assert all(SOLVER_EFFECTS[name].scope is not Scope.MODEL for name in drawn)


@pytest.mark.parametrize('name', SHARED)
def test_both_give_an_effect_the_same_parameters_units_and_ranges(name: str) -> None:
    ours, theirs = SOLVER_EFFECTS[name].parameters, RIG_EFFECTS[name].parameters
    assert list(ours) == list(theirs)
    for key, one in ours.items():
        other = theirs[key]
        assert (one.unit, one.is_name, one.neutral) == (other.unit, other.is_name, other.neutral)
        assert (one.above, one.low, one.high) == (other.above, other.low, other.high)
        assert one.default == other.default


@pytest.mark.parametrize('name', sorted(RIG_EFFECTS.keys() - SOLVER_EFFECTS.keys()))
def test_an_effect_of_the_virtual_rig_alone_is_drawn_from_outside_the_library(name: str) -> None:
    effect = RIG_EFFECTS[name]
    assert effect.blind_draw is not None
    assert set(effect.equal_to) <= SOLVER_EFFECTS.keys()


@pytest.mark.parametrize('name', SHARED)
def test_several_effects_of_one_kind_act_together_in_both(name: str) -> None:
    assert RIG_EFFECTS[name].is_repeatable is not SOLVER_EFFECTS[name].replaces_nominal
