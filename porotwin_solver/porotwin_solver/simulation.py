"""Free-running simulations: rates in, maps out, nothing of the observations in between."""

from collections.abc import Iterable, Iterator, Sequence

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
    preset: str = 'accurate',
    effects: Iterable[EffectDescription] = (),
    initial: FloatArray | None = None,
    start: float = 0.0,
) -> FloatArray:
    """Return the maps at `times` [s] as the camera would show them, (nt, nz, nx).

    See `simulated_maps`.
    """
    maps = simulated_maps(
        rig,
        schedule,
        times,
        grid=grid,
        preset=preset,
        effects=effects,
        initial=initial,
        start=start,
    )
    return np.array(list(maps)).reshape(-1, *grid.shape)


def simulated_maps(
    rig: Rig,
    schedule: Schedule,
    times: Sequence[float] | FloatArray,
    *,
    grid: Grid,
    preset: str = 'accurate',
    effects: Iterable[EffectDescription] = (),
    initial: FloatArray | None = None,
    start: float = 0.0,
    divisions: int | None = None,
) -> Iterator[FloatArray]:
    """Return an iterator of the maps (nz, nx) at `times` [s] as the camera would show them.

    The model runs from `initial` (nz, nx; no tracer where not given) at `start` [s] through the
    `schedule`, keeping its finer inner state all along. Effects of the rig and further `effects`
    act on physics and picture; a time before `start` shows the initial state. `divisions` are those
    of `Model`.

    Raises:
        InputError: times that decrease, NaN in `initial`, and all that `Model` refuses.
    """
    moments = np.asarray(times, dtype=float)
    if moments.ndim != 1 or not np.isfinite(moments).all() or (np.diff(moments) < 0).any():
        raise InputError('times: give finite seconds that do not decrease')
    model = Model(rig, grid, preset=preset, effects=effects, divisions=divisions)
    begin = model.initial_condition() if initial is None else model.checked(initial, 'initial')
    state = State.at_rest(refine(begin, model.engine.grid.shape))
    return _run(model, state, schedule, moments, start)


def _run(
    model: Model, state: State, schedule: Schedule, times: FloatArray, start: float
) -> Iterator[FloatArray]:
    engine, operator, now = model.engine, model.operator, start
    for time in times:
        target = time + operator.clock_offset
        for low, high, rates in schedule.intervals(now, target):
            engine.advance(state, rates, high - low)
        now = max(now, target)
        yield operator.shown(engine.seen(state), model.grid, float(time))
