"""Checks that a rig alone can answer: leaks, levels and the grid of plans."""

from dataclasses import replace

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.all_checks import OF_RIG, remarks_about
from porotwin_checks.known import Known
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, Control, EffectDescription, Rig

LEAK = EffectDescription(name='leak', parameters={'x': 0.4, 'z': 0.2, 'rate': -50.0})


def rig(*effects: EffectDescription, **boundaries: object) -> Rig:
    sides = Boundaries.model_validate({'top': 'closed', **boundaries})
    return box_rig(left=(0.1, 0.2)).model_copy(update={'boundaries': sides, 'effects': effects})


def codes(known: Known) -> list[str]:
    return [one.code for one in remarks_about(known, OF_RIG)]


def test_a_leak_of_a_closed_rig_is_impossible_unless_a_well_balances_it() -> None:
    closed = Known(rig=rig(LEAK))
    (remark,) = remarks_about(closed, OF_RIG)
    assert (remark.code, remark.refused) == ('unbalanced_rates', True)
    assert remark.facts['sum_ml_h'] == pytest.approx(-50.0)
    assert remark.facts['effects'] == 'leak'
    balanced = Schedule((ScheduleRow(0.0, 'left', WellRate(50.0e-6 / 3600.0)),))
    assert codes(replace(closed, pumped=balanced)) == []
    assert codes(Known(rig=rig(LEAK, top='open'))) == []
    assert codes(Known(rig=rig())) == []


def test_an_effect_that_begins_late_is_the_cause_from_then_on() -> None:
    stops = EffectDescription(name='rate', parameters={'well': 'b', 'factor': 0.0, 'since': 300.0})
    wells = {'a': WellRate(1e-8), 'b': WellRate(-1e-8)}
    rests = dict.fromkeys(wells, WellRate())
    two = box_rig(a=(0.1, 0.2), b=(0.4, 0.2))
    closed = two.model_copy(update={'boundaries': rig().boundaries, 'effects': (stops,)})

    def found(until: float) -> list[tuple[float, str, bool]]:
        rates = Schedule.from_rates([(0.0, wells), (until, rests)])
        told = remarks_about(Known(rig=closed, commanded=rates, pumped=rates), OF_RIG)
        return [(one.facts['time_s'], one.facts['effects'], one.refused) for one in told]

    assert found(600.0) == [(300.0, 'rate', True)]
    assert found(300.0) == []


def test_a_leak_may_go_on_when_the_wells_rest_at_the_end_but_not_before() -> None:
    wells, rests = {'left': WellRate(50.0e-6 / 3600.0)}, {'left': WellRate()}
    for last, expected in ((rests, []), ({'left': WellRate(1e-8)}, ['unbalanced_rates'])):
        rates = Schedule.from_rates([(0.0, wells), (600.0, last)])
        assert codes(Known(rig=rig(LEAK), commanded=rates, pumped=rates)) == expected
    rates = Schedule.from_rates([(0.0, wells), (300.0, rests), (600.0, wells)])
    assert codes(Known(rig=rig(LEAK), commanded=rates, pumped=rates)) == ['unbalanced_rates']


def test_refused_effects_are_left_to_the_model() -> None:
    wrong = EffectDescription(name='leak', parameters={'x': 40.0, 'z': 0.2, 'rate': -50.0})
    assert codes(Known(rig=rig(wrong))) == []


def test_levels_that_an_effect_makes_jump_in_a_corner_are_odd() -> None:
    level = EffectDescription(name='water_level', parameters={'left': 0.1})
    sides = {'top': 'open', 'left': 'open', 'heads_m': {'top': 0.4, 'left': 0.4}}
    assert 'levelled_heads' in codes(Known(rig=rig(level, **sides)))
    assert codes(Known(rig=rig(**sides))) == []


def test_a_barrier_that_the_grid_of_plans_does_not_close_is_odd() -> None:
    permeability = np.full((160, 240), 1e-10)
    permeability[:, 118:122] = 1e-14
    control = Control(
        wells=('left',), max_rate_ml_h=10.0, max_total_rate_ml_h=10.0,
        disallowed_zone_m=((0.3, 0.1), (0.5, 0.1), (0.5, 0.3)), fuzziness_m=0.01,
    )  # fmt: skip
    layered = rig(top='open').with_maps({'permeability_m2': permeability})
    fine = Known(rig=layered, chosen_cells=layered.grid(240, 160))
    assert codes(fine) == []
    planned = layered.model_copy(update={'control': control})
    assert codes(replace(fine, rig=planned)) == ['planning_grid']
