"""Cases with causes that begin during a recording."""

import pytest

from lab.blind.onset_check import TIMED, draw_onset
from porotwin_core.model.effect_parameter import onset
from porotwin_rig.effects import EffectSet
from porotwin_solver.effects import EFFECTS


@pytest.mark.parametrize('number', range(10))
def test_a_case_holds_one_cause_that_both_simulators_know(number: int) -> None:
    case = draw_onset(number, 7001)
    (effect,) = case.effects
    assert case.right == (effect.name,) == (TIMED[number % len(TIMED)],)
    assert EffectSet.checked(case.effects, case.rig).members
    assert EFFECTS[effect.name].checked(effect.parameters)
    assert 0.2 <= onset(effect) / case.duration <= 0.5 or effect.name == 'dead_volume'
    assert draw_onset(number, 7001) == case != draw_onset(number, 7002)
