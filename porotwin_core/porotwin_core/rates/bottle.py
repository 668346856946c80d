"""The tracer stock in its bottle: how much a plan leaves, and when it is empty."""

import math
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, ML
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig


class Bottle(NamedTuple):
    """The stock in the bottle.

    Attributes:
        left: at the asked time [m^3]; 0 if it is empty.
        empty_at: when the plan has taken all of it [s]; infinite if it never does.
    """

    left: float
    empty_at: float


def bottle_at(rig: Rig, plan: Schedule, time: float) -> Bottle | None:
    """Return the bottle of `rig` at `time` [s] by the rates of `plan`; None if it has no volume."""
    if rig.control is None or rig.control.stock_ml is None:
        return None
    full = rig.control.stock_ml / ML
    flows: dict[str, float] = {}
    times, taken = [0.0], [0.0]
    for moment, row in [*((row.time, row) for row in plan.rows), (LONGEST_EXPERIMENT_S, None)]:
        taken.append(taken[-1] + sum(flows.values()) * max(moment - times[-1], 0.0))
        times.append(max(moment, times[-1]))
        if row is not None:
            flows[row.well] = max(row.rate.rate, 0.0) * row.rate.concentration
    left = full - float(np.interp(time, times, taken))
    last = int(np.searchsorted(taken, full, side='right'))
    empty_at = float(np.interp(full, taken, times)) if last < len(taken) else math.inf
    return Bottle(left if left > ROUND_OFF * full else 0.0, empty_at)
