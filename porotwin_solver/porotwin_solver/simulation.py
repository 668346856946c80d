"""Free-running simulations: rates in, maps out, nothing of the observations in between."""

from collections.abc import Iterable, Sequence

import numpy as np
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.wells import Schedule

from porotwin_solver.engine import State
from porotwin_solver.model import Model
from porotwin_solver.refinement import refine


def simulate(
    rig: Rig,
    schedule: Schedule,
    times: Sequence[float] | FloatArray,
    *,
    grid: Grid,
    setting: str = 'accurate',
    effects: Iterable[EffectDescription] = (),
    initial: FloatArray | None = None,
    start: float = 0.0,
) -> FloatArray:
    """Return the maps at `times` [s] as the camera would show them, (nt, nz, nx).

    The model runs from `initial` (nz, nx; no tracer where not given) at `start` [s] through the
    `schedule`, keeping its finer inner state all along. Effects of the rig and further `effects`
    act on physics and picture; a time before `start` shows the initial state.

    Raises:
        InputError: times that do not increase, NaN in `initial`, and all that `Model` refuses.
    """
    moments = np.asarray(times, dtype=float)
    if moments.ndim != 1 or not np.isfinite(moments).all() or (np.diff(moments) < 0).any():
        raise InputError('times: give finite seconds in increasing order')
    model = Model(rig, grid, setting=setting, effects=effects)
    engine, view = model.engine, model.view
    begin = model.initial_condition() if initial is None else model.checked(initial, 'initial')
    state = State.at_rest(refine(begin, engine.grid.shape))
    now = start
    maps = np.empty((len(moments), *grid.shape))
    for index, time in enumerate(moments):
        target = time + view.clock_offset
        for low, high, rates in schedule.intervals(now, target):
            engine.advance(state, rates, high - low)
        now = max(now, target)
        maps[index] = view.shown(engine.seen(state), grid, time)
    return maps
