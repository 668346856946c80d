"""Does a well balance the leaks of a closed rig? Without one no model predicts."""

import math
from collections.abc import Iterator
from dataclasses import replace

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.announced_rates import uncontrolled_rates
from porotwin_solver.effects import acting, described_physics
from porotwin_solver.model.water_balance import water_balance

UNBALANCED = (
    '{leaks_ml_h:+g} ml/h leak into a rig whose sides are all closed; remove the leak, balance it '
    'with the wells, or open a side in rig.yaml'
)


def _find(known: Known) -> Iterator[Remark]:
    """Yield a refusal. Effects that the model refuses as a whole are told by those who use it."""
    rig, grid = known.rig, known.cells
    if not rig.closed:
        return
    now = rig.model_copy(update={'effects': acting(rig.effects, known.end or math.inf)})
    rates = (known.pumped or uncontrolled_rates(rig)).busiest
    try:
        leaks = to_ml_h(math.fsum(leak.rate for leak in described_physics(now, grid).leaks))
        balanced = not leaks or water_balance(now, grid, rates) is not None
    except InputError:
        return
    if not balanced:
        yield replace(Remark.of('leaks', '', UNBALANCED, leaks_ml_h=leaks), refused=True)


CHECK = Check(needs=('rig',), find=_find)
