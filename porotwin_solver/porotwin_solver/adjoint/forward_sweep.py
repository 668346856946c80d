"""The forward sweep: a simulation that keeps the state before every splitting step."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_solver.adjoint.step_recorder import StepRecorder
from porotwin_solver.coefficients.refinement import refine
from porotwin_solver.model.engine import State, StepRecord
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.model import Model

Cost = Callable[[int, FloatArray], tuple[float, FloatArray]]
"""From the index of a time and its map (nz, nx) to the map's part of the cost J and dJ/dmap."""


@dataclass
class Interval:
    """A part of the simulation, from `start` to `end` [s], with constant rates.

    longest_step: bound of its splitting steps [s].
    observed: indices of the times whose map shows its last state.
    states: the state before every splitting step, and the last one if it is observed.
    records: of every splitting step, where it was recorded.
    """

    start: float
    end: float
    rates: WellRates
    longest_step: float
    observed: list[int] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    records: list[StepRecord | None] = field(default_factory=list)


@dataclass(frozen=True)
class ForwardSweep:
    """A finished simulation: its cost J, `map_bars` = dJ/dmap (nz, nx) by time, and its intervals.

    J has the unit of the cost function. The keys of `map_bars` are indices of the times.
    """

    cost: float
    map_bars: dict[int, FloatArray]
    intervals: list[Interval]


def sweep_forward(
    model: Model,
    schedule: Schedule,
    times: FloatArray,
    start: float,
    cost: Cost,
    *,
    varied: bool = False,
) -> ForwardSweep:
    """Simulate from `start` [s] and return the sum of `cost` over the maps at `times` [s].

    `varied` tells that derivatives by parameters are wanted.

    Raises:
        InputError: an unknown well, or rates that do not balance in a closed rig.
    """
    engine, operator = model.engine, model.observation_operator
    intervals, observed_before = _intervals(model, schedule, times, start)
    state = State.equilibrium(refine(model.initial_condition(), engine.grid.shape))
    total, map_bars = 0.0, {}
    recorder = StepRecorder(engine, varied=varied)

    def observe(indices: Iterable[int]) -> None:
        nonlocal total
        concentration = engine.mean_concentration(state)
        for index in indices:
            shown = operator.apply(concentration, model.grid, float(times[index]))
            part, map_bars[index] = cost(index, shown)
            total += part

    observe(observed_before)
    for interval in intervals:
        duration = interval.end - interval.start
        longest_step = interval.longest_step
        for coefficients in engine.interval(state, interval.rates, duration, longest_step):
            interval.states.append(state.copy())
            interval.records.append(recorder.step(state, coefficients))
        if interval.observed:
            interval.states.append(state.copy())
            observe(interval.observed)
    return ForwardSweep(total, map_bars, intervals)


def _intervals(
    model: Model, schedule: Schedule, times: FloatArray, start: float
) -> tuple[list[Interval], list[int]]:
    """Return the intervals up to the last time, and the indices of times before the first one."""
    intervals: list[Interval] = []
    observed_before: list[int] = []
    now = start
    for index, time in enumerate(times):
        target = time + model.observation_operator.clock_offset
        for low, high, rates in schedule.intervals(now, target):
            longest_step = longest_free_step(model.engine.physics, rates)
            intervals.append(Interval(low, high, rates, longest_step))
        now = max(now, target)
        observed = intervals[-1].observed if intervals else observed_before
        observed.append(index)
    return intervals, observed_before
