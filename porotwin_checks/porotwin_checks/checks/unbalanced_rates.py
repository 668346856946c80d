"""Does the water of a closed rig balance at every time, with its effects? It has no other way out.

Photographs can be evaluated without, but no model predicts with such rates.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h
from porotwin_core.model.effect_parameter import onset
from porotwin_core.rates.announced_rates import uncontrolled_rates
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import acting, described_physics

Effects = tuple[EffectDescription, ...]

UNBALANCED = (
    'the rates add up to {sum_ml_h:.6g} ml/h, but all sides are closed; balance injection and '
    'production, or open a side in rig.yaml'
)
BY_EFFECTS = (
    'with {effects} in effects of rig.yaml, wells and leaks add up to {sum_ml_h:.6g} ml/h, but all '
    'sides are closed; correct it, balance it with the wells, or open a side in rig.yaml'
)


def _find(known: Known) -> Iterator[Remark]:
    """Yield a remark about the first time with a sum that is not zero, refused if effects cause it.

    The model runs with the rates that were measured, where somebody measured them. Effects that the
    model refuses as a whole are told by those who use it.
    """
    if not known.rig.closed:
        return
    rates = known.pumped or known.commanded or uncontrolled_rates(known.rig)
    effects, end = known.rig.effects, known.end or math.inf
    changes: dict[float, dict[str, WellRate]] = {0.0: {}, **{onset(one): {} for one in effects}}
    for row in rates.rows:
        changes.setdefault(row.time, {})[row.well] = row.rate
    now: dict[str, WellRate] = {}
    models: dict[int, Physics] = {}  # by how many effects act: an effect that began stays
    for time in sorted(changes):
        now |= changes[time]
        if time > end or (time == end and not any(one.rate for one in now.values())):
            return  # wells that rest at the end show that it is over
        acts = acting(effects, time)
        try:
            if len(acts) not in models:
                models[len(acts)] = _physics(known, acts)
            if (net := models[len(acts)].surplus(now)) == 0.0:
                continue
            causes = dict.fromkeys(
                one.name
                for one in acts
                if _physics(known, tuple(a for a in acts if a is not one)).surplus(now) != net
            )
        except InputError:
            return
        facts = {'time_s': time, 'sum_ml_h': to_ml_h(net), 'effects': ' and '.join(causes)}
        words = BY_EFFECTS if causes else UNBALANCED
        remark = Remark.of(f'rates at {time:g} s', 'unbalanced_rates', words, **facts)
        yield replace(remark, refused=bool(causes))
        return


def _physics(known: Known, effects: Effects) -> Physics:
    return described_physics(known.rig.model_copy(update={'effects': effects}), known.cells)


CHECK = Check(needs=('rig',), find=_find)
