"""Free-running simulations: from rates to maps, without observations in between."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.refinement import refine
from porotwin_solver.coefficients.tubes import through_tubes
from porotwin_solver.model.engine import PROCESSOR, Engine, State
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.model import Model


@one_blas_thread()
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
    """Return the maps at `times` [s] as the camera shows them, (nt, nz, nx).

    The arguments are as in `simulated_maps`.

    Raises:
        InputError: as `simulated_maps`.
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
    refinement: int | None = None,
    device: str = PROCESSOR,
) -> Iterator[FloatArray]:
    """Return an iterator of the maps (nz, nx) at `times` [s] as the camera shows them.

    The model runs from `initial` (nz, nx; default: no tracer) at `start` [s] through the
    `schedule`. It keeps its state on the refined grid between the maps. The effects of the rig and
    further `effects` act on physics and picture. A time before `start` shows the initial state.
    `preset`, `refinement` and `device` are as in `Model`.

    Raises:
        InputError: times that decrease or are not finite, NaN in `initial`, or as `Model`.
    """
    moments = np.asarray(times, dtype=float)
    if moments.ndim != 1 or not np.isfinite(moments).all() or (np.diff(moments) < 0).any():
        raise InputError('times: give finite seconds that do not decrease')
    model = Model(rig, grid, preset=preset, effects=effects, refinement=refinement, device=device)
    begin = (
        model.initial_condition() if initial is None else model.validated_map(initial, 'initial')
    )
    return maps_of(model, schedule, moments, initial=begin, start=start)


def maps_of(
    model: Model, schedule: Schedule, times: FloatArray, *, initial: FloatArray, start: float
) -> Iterator[FloatArray]:
    """Yield the maps (nz, nx) of `model` at ascending `times` [s] as the camera shows them.

    It runs from the map `initial` (nz, nx) at `start` [s] through the `schedule`.

    Raises:
        InputError: an unknown well, or rates that do not balance in a closed rig.
    """
    state = State.equilibrium(refine(initial, model.engine.grid.shape))
    now = start
    latest, step = None, 0.0
    for time in times:
        target = time + model.observation_operator.clock_offset
        for low, high, engine, rates in intervals(model, schedule, now, target):
            if (engine, rates) != latest:
                latest, step = (engine, rates), longest_free_step(engine.physics, rates)
            engine.advance(state, rates, high - low, step)
        now = max(now, target)
        shown = model.at(now).engine.mean_concentration(state)
        yield model.at(time).observation_operator.apply(shown, model.grid, float(time))


def intervals(
    model: Model, schedule: Schedule, start: float, end: float
) -> Iterator[tuple[float, float, Engine, WellRates]]:
    """Yield (start, end, engine, rates) of the parts of a free run with constant rates and effects.

    The concentrations of `schedule` are those that enter the tubes of the wells.

    Raises:
        InputError: as `Model.at`.
    """
    edges = sorted({start, *(time for time in model.onsets if start < time < end), max(start, end)})
    through = through_tubes(schedule, model.physics)
    for begin, until in pairwise(edges):
        engine = model.at(begin).engine
        for low, high, rates in through.intervals(begin, until):
            yield low, high, engine, rates
