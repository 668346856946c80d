"""The gate judges free runs: it decides on the trust in a correction and the range of rates.

The model alone and the corrected model run freely over kept experiments; the errors of single steps
do not count. The trust in the network is the largest one of TRUSTS with about the least error. No
frame of a run may be worse than LARGEST_LOSS times the model alone. Learnt physics is judged in the
same way.

Pauses outlast recordings. So every kept run is continued without pumping for as long again. There
the network may change the maps by no more than during the run: without flow little happens.

Rates outside the training are tested on the same maps. If nothing but pumped water moves the
tracer, s times the rates give the same maps s times as fast. Where the corrected run of such maps
is no worse than the model alone, the trained range of rates is widened by s.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, fill_unseen, relative_error
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver, StepModel
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate, WellRates
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.corrective_source import LearntStep, corrective_source
from porotwin_costa.data.frames import Frames, cut, sequences

TRUSTS = (1.0, 0.5, 0.0)
"""Shares of the network's answer that are tried."""

SAME_ERROR = 1.1
"""Largest ratio of two errors of kept runs that counts as equal [-]: one or two runs do not tell a
tenth, and the network was trained to be used as a whole."""

LARGEST_LOSS = 1.02
"""Largest error of a corrected run relative to the model alone, at any frame [-]."""

LEAST_ERROR = 0.01
"""Errors below this are equal [-]: noise decides which one is smaller."""

SETTLED = 0.1
"""Share of a run that is not judged: the first little plume makes every relative error large."""

LARGEST_REST = 1.0
"""Largest change of a map by the network during a pause, relative to its change by the end of the
kept run before it [-]; LEAST_ERROR is added to both."""

RATE_FACTORS = (0.5, 2.0)
"""Factors on the rates that are tested."""


@dataclass(frozen=True)
class RunErrors:
    """Errors of free runs at every judged frame, of the model `alone` and `corrected` [-]."""

    alone: FloatArray
    corrected: FloatArray

    @property
    def mean_alone(self) -> float:
        """The mean over the frames [-]."""
        return float(np.mean(self.alone))

    @property
    def mean_corrected(self) -> float:
        """The mean over the frames [-]."""
        return float(np.mean(self.corrected))

    @property
    def worst_ratio(self) -> float:
        """The largest ratio of corrected to alone over the frames [-]."""
        return float(np.max((self.corrected + LEAST_ERROR) / (self.alone + LEAST_ERROR)))

    @property
    def harmless(self) -> bool:
        """Whether no frame is worse than LARGEST_LOSS times the model alone."""
        return self.worst_ratio <= LARGEST_LOSS


@dataclass(frozen=True)
class KeptRun:
    """A kept experiment; its frames after `judged_from` [s] are judged."""

    frames: Frames
    judged_from: float


def kept_runs(experiments: Sequence[Frames], share: float) -> tuple[list[Frames], list[KeptRun]]:
    """Return the frames to learn from, and the runs that are kept to judge.

    The last experiments are kept, a `share` of all frames at least but never more than half. The
    end of a single experiment is kept; its free run still begins with the experiment.
    """
    runs = [run for frames in experiments for run in sequences(frames) if len(run.times) > 2]
    total = sum(len(run.times) for run in runs)
    kept: list[Frames] = []
    while len(runs) > 1 and sum(len(run.times) for run in kept) < share * total:
        kept.append(runs.pop())
    if kept:
        return runs, [_settled(run) for run in kept]
    learnt, judged = [], []
    for run in runs:
        count = max(2, round((1 - share) * len(run.times)))
        learnt.append(_first(run, count))
        judged.append(KeptRun(run, float(run.times[count - 1])))
    return learnt, judged


class Judge:
    """Free runs over kept experiments, with and without a correction."""

    def __init__(self, solver: LearntSolver, runs: Sequence[KeptRun], time_step: float) -> None:
        """Judge on `runs`, in steps of `time_step` [s]."""
        self._solver, self._runs, self._time_step = solver, runs, time_step
        self._plain = solver.model(LearntPhysics())
        self._alone = [self._errors(run, None) for run in runs]

    @property
    def alone(self) -> FloatArray:
        """The errors of all kept runs of the model alone [-]."""
        return _joined(self._alone)

    def check(self) -> None:
        """Check that there is something to judge.

        Raises:
            InputError: no kept map shows tracer, so that no error is defined.
        """
        if not len(self.alone):
            raise InputError(
                'no map that is kept to judge COSTA shows tracer; name recordings whose last maps '
                'hold some'
            )

    def errors(self, model: CorrectiveModel) -> RunErrors:
        """Return the errors of all kept runs with `model`, and without."""
        correct = corrector(model, self._solver)
        return RunErrors(self.alone, _joined([self._errors(run, correct) for run in self._runs]))

    def physics_error(self, physics: LearntPhysics) -> float:
        """Return the mean error of all kept runs of the model with `physics`, no network [-]."""
        better = self._solver.model(physics)

        def correct(
            _: StepModel, previous: FloatArray, __: FloatArray, rates: WellRates, time_step: float
        ) -> FloatArray:
            return np.clip(better.predict(previous, rates, time_step), 0.0, 1.0)

        return float(np.mean(_joined([self._errors(run, correct) for run in self._runs])))

    def at_rates(self, model: CorrectiveModel, factor: float) -> RunErrors:
        """Return the errors at `factor` times the rates, none of runs too short; see the module."""
        runs = [faster(run, factor, self._time_step) for run in self._runs]
        judge = Judge(
            self._solver, [run for run in runs if len(run.frames.times) > 2], self._time_step
        )
        return judge.errors(model)

    def rests(self, model: CorrectiveModel) -> bool:
        """Return whether the network of `model` leaves the tracer alone during a pause.

        See LARGEST_REST.
        """
        whole = corrector(model, self._solver)
        physics = corrector(replace(model, trust=0.0), self._solver)
        return all(self._rests(run.frames, whole, physics) for run in self._runs)

    def _rests(self, frames: Frames, whole: 'CorrectorFn', physics: 'CorrectorFn') -> bool:
        (*_, end), (*_, other) = self._states(frames, whole), self._states(frames, physics)
        moved = relative_error(end, other)
        paused = other = end
        for _ in frames.times[1:]:
            paused = self._next(paused, {}, self._time_step, whole)
            other = self._next(other, {}, self._time_step, physics)
        changed = relative_error(paused, other)
        return changed + LEAST_ERROR <= LARGEST_REST * (moved + LEAST_ERROR)

    def _errors(self, run: KeptRun, correct: 'CorrectorFn | None') -> FloatArray:
        frames, errors = run.frames, []
        states = self._states(frames, correct)
        rows = zip(frames.times[1:], states, frames.concentration[1:], strict=True)
        for end, state, observed in rows:
            error = relative_error(state, observed)
            if end > run.judged_from and np.isfinite(error):
                errors.append(error)
        return np.array(errors)

    def _states(self, frames: Frames, correct: 'CorrectorFn | None') -> Iterator[FloatArray]:
        """Yield the map of the free run at every frame after the first one."""
        state = fill_unseen(frames.concentration[0].astype(float), None)
        for start, end in pairwise(map(float, frames.times)):
            rates = frames.schedule.mean(start, end)
            state = self._next(state, rates, end - start, correct)
            yield state

    def _next(
        self,
        state: FloatArray,
        rates: WellRates,
        time_step: float,
        correct: 'CorrectorFn | None',
    ) -> FloatArray:
        predicted = self._plain.predict(state, rates, time_step)
        if correct is None:
            return predicted
        return correct(self._plain, state, predicted, rates, time_step)


def _joined(errors: Sequence[FloatArray]) -> FloatArray:
    """Return the errors of all runs, flat; empty without a run."""
    return np.concatenate([np.zeros(0), *errors])


CorrectorFn = Callable[[StepModel, FloatArray, FloatArray, WellRates, float], FloatArray]
"""(model alone, previous, predicted, rates, time step [s]) -> corrected map (nz, nx)."""


def corrector(model: CorrectiveModel, solver: LearntSolver) -> CorrectorFn:
    """Return the correction of a prediction by `model`, as the twin applies it."""
    physics = None if model.learnt is None else LearntStep(model.learnt, solver)

    def correct(
        plain: StepModel,
        previous: FloatArray,
        predicted: FloatArray,
        rates: WellRates,
        time_step: float,
    ) -> FloatArray:
        answer = corrective_source(model, predicted, rates, time_step, previous, physics=physics)
        return answer.applied_to(
            predicted, lambda sigma: plain.correct(previous, sigma, rates, time_step)
        )

    return correct


def gated(model: CorrectiveModel, judge: Judge) -> CorrectiveModel:
    """Return `model` with the trust, the learnt physics and the range of rates that proved good.

    The entry `gate` of its provenance holds the decision.
    """
    tried = [replace(model, trust=trust) for trust in TRUSTS]
    if model.learnt is not None:
        tried.append(replace(model, trust=0.0, learnt=None))
    judged = [(one, judge.errors(one)) for one in tried]
    harmless = [
        (one, errors)
        for one, errors in judged
        if errors.harmless and (one.trust == 0.0 or judge.rests(one))
    ]
    chosen, errors = nearly_best(harmless or judged[-1:])
    low, high = 1.0, 1.0
    passed = []
    for factor in RATE_FACTORS if chosen.trust > 0 else ():
        anywhere = replace(chosen, trained_on=chosen.trained_on.widened(0.0, 2.0 * factor))
        scaled = judge.at_rates(anywhere, factor)
        if len(scaled.alone) and scaled.mean_corrected <= scaled.mean_alone:
            passed.append(factor)
            low, high = min(low, factor), max(high, factor)
    learnt = chosen.learnt or NO_LEARNT_PHYSICS
    gate = {
        'alone': errors.mean_alone,
        'corrected': errors.mean_corrected,
        'worst_ratio': errors.worst_ratio,
        'trust': chosen.trust,
        'physics': replace(learnt, scheme='') != NO_LEARNT_PHYSICS,
        'scheme': learnt.scheme,
        'rates_passed': passed,
    }
    return replace(
        chosen,
        trained_on=chosen.trained_on.widened(low, high),
        provenance={**chosen.provenance, 'gate': {**gate, 'says': _decision(gate)}},
    )


def nearly_best(
    judged: Sequence[tuple[CorrectiveModel, RunErrors]],
) -> tuple[CorrectiveModel, RunErrors]:
    """Return the first one whose mean error is not clearly larger than the least."""
    least = min(errors.mean_corrected for _, errors in judged)
    return next(pair for pair in judged if pair[1].mean_corrected <= SAME_ERROR * least)


def _decision(gate: Mapping[str, Any]) -> str:
    """Return the decision as a line for a person."""
    if not (gate['trust'] or gate['physics'] or gate['scheme']):
        return f'gate shut: nothing lowers the free-run error {gate["alone"]:.3f} of kept maps'
    applied = [
        *(['learnt physics'] if gate['physics'] else []),
        *([f'the scheme {gate["scheme"]}'] if gate['scheme'] else []),
        *([f'{percent(gate["trust"])} of the network'] if gate['trust'] else []),
    ]
    rates = ', '.join(f'{factor:g}' for factor in gate['rates_passed'])
    tested = f'; also at {rates} times the rates' if rates else ''
    return (
        f'gate open for {", ".join(applied)}: free-run error {gate["corrected"]:.3f} instead of '
        f'{gate["alone"]:.3f} on kept maps; the worst map has {gate["worst_ratio"]:.2f} times its '
        f'error without COSTA{tested}'
    )


def faster(run: KeptRun, factor: float, time_step: float) -> KeptRun:
    """Return the run at `factor` times the rates and speed, in frames `time_step` [s] apart.

    Maps between two frames are interpolated in time.
    """
    frames, start = run.frames, float(run.frames.times[0])
    times = np.arange(start, start + (frames.times[-1] - start) / factor + 1e-9, time_step)
    before = np.interp(start + (times - start) * factor, frames.times, np.arange(len(frames.times)))
    low = np.minimum(before.astype(int), len(frames.times) - 2)
    share = (before - low)[:, None, None]
    maps = (1.0 - share) * frames.concentration[low] + share * frames.concentration[low + 1]
    rows = tuple(
        ScheduleRow(
            start + (row.time - start) / factor,
            row.well,
            WellRate(factor * row.rate.rate, row.rate.concentration),
        )
        for row in frames.schedule.rows
    )
    made = Frames(times, maps, Schedule(rows), name=frames.name)
    return KeptRun(made, start + (run.judged_from - start) / factor)


def _settled(run: Frames) -> KeptRun:
    return KeptRun(run, float(run.times[0] + SETTLED * (run.times[-1] - run.times[0])))


def _first(frames: Frames, count: int) -> Frames:
    return cut(frames, float(frames.times[count - 1]))
