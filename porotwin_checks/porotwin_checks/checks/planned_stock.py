"""Is there enough tracer stock for the plan, and does it go where the objective wants tracer?"""

import contextlib
from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.rates.announced_rates import uncontrolled_rates
from porotwin_core.rates.bottle import bottle_at
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig.control_zones import unwanted_tracer
from porotwin_solver.model.rates_into_sand import rates_of_pumps


def pumped_plan(known: Known) -> Schedule:
    """Return the rates that leave the bottles, as recorded or else as rig.yaml says."""
    plan = known.pumped or uncontrolled_rates(known.rig)
    with contextlib.suppress(InputError):  # who uses the model tells it
        return rates_of_pumps(known.rig, plan)
    return plan


def _find(known: Known) -> Iterator[Remark]:
    rig, end = known.rig, known.end
    for name, well in ({} if rig.control is None else rig.control.fixed).items():
        place = np.array([[rig.wells[name].x_m, rig.wells[name].z_m]])
        unwanted = unwanted_tracer(rig, place)
        if well.rate_ml_h > 0.0 and well.concentration > 0.0 and unwanted is not None and unwanted:
            yield Remark(
                'control.objective',
                '',
                f'well {name} injects tracer where it wants none',
                'compare the zone in the picture of `check` with the rig; a picture of a zone '
                'shows the zone bright',
                code='stock_in_zone',
            )
    plan = pumped_plan(known)
    bottle = bottle_at(rig, plan, end)
    if bottle is not None and bottle.empty_at < end:
        why = f'the bottle is empty at {bottle.empty_at:.0f} s, before the end at {end:g} s'
        remedy = f'the plan takes {plan.injected_stock(0.0, end) * ML:.4g} ml; fill in more'
        yield Remark('control.stock_ml', '', why, remedy, code='empty_bottle')


CHECK = Check(needs=('rig',), find=_find)
