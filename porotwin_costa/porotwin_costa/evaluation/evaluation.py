"""Errors per frame with and without the correction, one step ahead and free-running.

One step: predict and correct from the observed frame n, compare with frame n + 1. Free-running: the
model starts at the first frame of an uninterrupted sequence and continues from its own results; the
corrected run continues from its own corrected states (paper, section 3.2, accumulated error).
"""

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.geometry.grid import FloatArray, fill_unseen, relative_error
from porotwin_core.model.correction import CorrectionFn
from porotwin_core.model.held_out_share import held_out_begin
from porotwin_core.rates.wells import WellRates
from porotwin_costa.correction.corrective_source import APPLIED
from porotwin_costa.data.dataset_builder import PredictFn
from porotwin_costa.data.frames import Frames, frame_pairs, mean_rates

CorrectFn = Callable[[FloatArray, FloatArray, WellRates, float], FloatArray]
"""(previous, sigma [1/s], rates, time step [s]) -> corrected concentration."""

PAPER_TIMES = (600.0, 1800.0)
"""Times of the paper's figures costa-10 and costa-30 [s]."""


@dataclass(frozen=True)
class FrameErrors:
    """Errors [-] of one predicted frame, relative to the observed one: ||c - c_obs|| / ||c_obs||.

    `time` [s] and `experiment` name the observed frame. Only observed cells count. Errors are NaN
    where no tracer was observed. `predicted` and `corrected` are errors of one step; `free_...` are
    those of a run from the first frame on. The mass defects [-] of the one-step predictions are
    (sum c - sum c_obs) / sum c_obs. `status` and `free_status` say whether
    sigma was applied, and why not.
    """

    experiment: str
    time: float
    predicted: float
    corrected: float
    free_predicted: float
    free_corrected: float
    predicted_mass: float
    corrected_mass: float
    status: str
    free_status: str


@dataclass(frozen=True)
class FrameFields:
    """Concentrations (nz, nx) [-] at `time` [s], for files and pictures.

    `predicted` and `corrected` are one step ahead; `free_...` are those of a run from the first
    frame on. `observed` is the map that they are compared with.
    """

    experiment: str
    time: float
    observed: FloatArray
    predicted: FloatArray
    corrected: FloatArray
    free_predicted: FloatArray
    free_corrected: FloatArray


@dataclass(frozen=True)
class Evaluation:
    """The errors of all frames, `time_step` [s] after the ones before, and some of the fields."""

    frames: tuple[FrameErrors, ...]
    shown: tuple[FrameFields, ...]
    time_step: float

    def mean(self, name: str) -> float:
        """Return the mean [-] of a column of `FrameErrors` over the frames where it is not NaN."""
        return _mean(self.frames, name)

    def by_recording(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return for every recording the mean errors [-] of the `model` and with `costa`.

        `one_step` is the mean over all frames, `free_running_end` the error of the last frame and
        `free_running_last_30_percent` the mean over the last 30 % of the time.
        """
        found = {}
        for name in dict.fromkeys(frame.experiment for frame in self.frames):
            frames = tuple(frame for frame in self.frames if frame.experiment == name)
            begin = held_out_begin(frames[0].time - self.time_step, frames[-1].time)
            late = tuple(frame for frame in frames if frame.time >= begin)
            found[name] = {
                'one_step': _means(frames, 'predicted', 'corrected'),
                'free_running_end': _means(frames[-1:], 'free_predicted', 'free_corrected'),
                'free_running_last_30_percent': _means(late, 'free_predicted', 'free_corrected'),
            }
        return found

    def table(self) -> str:
        """Return a table for a person: mean errors, and the last ones of the free run."""
        names = dict.fromkeys(frame.experiment for frame in self.frames)
        shown = {name: '/'.join(Path(name).parts[-2:]) for name in names}
        width = max(map(len, ('experiment', *shown.values())))
        lines = [f'{"experiment":{width}} frames   one step: PBM   COSTA   free-run: PBM   COSTA']
        for name in names:
            own = tuple(frame for frame in self.frames if frame.experiment == name)
            lines.append(
                f'{shown[name]:{width}} {len(own):6d}   {_mean(own, "predicted"):13.4f}'
                f' {_mean(own, "corrected"):7.4f}   {own[-1].free_predicted:13.4f}'
                f' {own[-1].free_corrected:7.4f}'
            )
        withheld = [frame.status for frame in self.frames if frame.status != APPLIED]
        if withheld:
            count = f'{len(withheld)} of {len(self.frames)} frames'
            lines.append(f'not the whole correction in {count}; the first: {withheld[0]}')
        return '\n'.join(lines)

    def write_csv(self, path: Path) -> None:
        """Write one row per frame."""
        with path.open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            names = [item.name for item in fields(FrameErrors)]
            writer.writerow(names)
            writer.writerows([getattr(frame, name) for name in names] for frame in self.frames)


def evaluate(
    experiments: Iterable[Frames],
    *,
    time_step: float,
    predict: PredictFn,
    correct: CorrectFn,
    correction: CorrectionFn,
    references: Sequence[Frames] = (),
    shown_times: Sequence[float] = PAPER_TIMES,
    see: Callable[[FrameFields], None] = lambda _: None,
) -> Evaluation:
    """Return the errors of every frame that follows another by `time_step` [s].

    Unseen cells are filled from the last corrected prediction, as in the twin. The free run starts
    again after an interruption, a gap, or a frame that shows too little.

    Args:
        experiments: observed maps on the grid of the models.
        time_step: length of a step [s].
        predict: the physics-based model.
        correct: the physics-based model with a corrective source term.
        correction: the data-driven model.
        references: better maps of each experiment, such as the virtual rig's own. Errors are then
            relative to them; steps still start at the observed maps. None: the observed maps.
        shown_times: times [s] of the frames whose fields are kept.
        see: called with the fields of each frame.

    Raises:
        InputError: no frame can be evaluated, or a reference has no map of its time.
    """
    models = _Models(predict, correct, correction, time_step)
    errors: list[FrameErrors] = []
    shown: list[FrameFields] = []
    names = []
    for experiment, reference in zip_longest(experiments, references):
        names.append(experiment.name)
        for frame_errors, frame_fields in _frames(experiment, models, reference):
            errors.append(frame_errors)
            if any(abs(frame_errors.time - wanted) < time_step / 2 for wanted in shown_times):
                shown.append(frame_fields)
            see(frame_fields)
    if not errors:
        raise InputError(
            f'{", ".join(names) or "no recording"}: no two known frames {time_step:g} s apart, the '
            'time step of the model; train one for the interval of these frames'
        )
    return Evaluation(tuple(errors), tuple(shown), time_step)


def _mean(frames: Sequence[FrameErrors], name: str) -> float:
    values = np.array([getattr(frame, name) for frame in frames])
    defined = values[~np.isnan(values)]
    return float(np.mean(defined)) if len(defined) else float('nan')


def _means(frames: Sequence[FrameErrors], model: str, costa: str) -> dict[str, float]:
    return {'model': _mean(frames, model), 'costa': _mean(frames, costa)}


class _Models(NamedTuple):
    predict: PredictFn
    correct: CorrectFn
    correction: CorrectionFn
    time_step: float

    def step(self, start: FloatArray, rates: WellRates) -> tuple[FloatArray, FloatArray, str]:
        """Return prediction, corrected prediction and status one time step after `start`."""
        predicted = self.predict(start, rates, self.time_step)
        answer = self.correction(predicted, rates, self.time_step, start)
        corrected = answer.applied_to(
            predicted, lambda sigma: self.correct(start, sigma, rates, self.time_step)
        )
        return predicted, corrected, answer.status


def _frames(
    experiment: Frames, models: _Models, reference: Frames | None
) -> Iterator[tuple[FrameErrors, FrameFields]]:
    """Yield errors and fields of each frame that follows another by a time step.

    Raises:
        InputError: the `reference` has no map of the time of a frame.
    """
    free_predicted = free_corrected = prediction = None
    sequence = 0
    for pair in frame_pairs(experiment, models.time_step, Counter()):
        if pair.sequence != sequence:
            prediction, sequence = None, pair.sequence
        start, end = (float(experiment.times[pair.number + k]) for k in (0, 1))
        before = np.asarray(experiment.concentration[pair.number], dtype=float)
        observed = np.asarray(experiment.concentration[pair.number + 1], dtype=float)
        if reference is not None:
            observed = _map_at(reference, end)
        rates = mean_rates(experiment.schedule, start, end)
        before = fill_unseen(before, prediction)
        if free_predicted is None or free_corrected is None or not pair.follows:
            free_predicted = free_corrected = before
        predicted, corrected, status = models.step(before, rates)
        free_predicted = models.predict(free_predicted, rates, models.time_step)
        _, free_corrected, free_status = models.step(free_corrected, rates)
        prediction = corrected
        errors = FrameErrors(
            experiment=experiment.name,
            time=end,
            predicted=relative_error(predicted, observed),
            corrected=relative_error(corrected, observed),
            free_predicted=relative_error(free_predicted, observed),
            free_corrected=relative_error(free_corrected, observed),
            predicted_mass=_mass_defect(predicted, observed),
            corrected_mass=_mass_defect(corrected, observed),
            status=status,
            free_status=free_status,
        )
        yield (
            errors,
            FrameFields(
                experiment.name,
                end,
                observed,
                predicted,
                corrected,
                free_predicted,
                free_corrected,
            ),
        )


def _map_at(frames: Frames, time: float) -> FloatArray:
    """Return the map (nz, nx) at `time` [s].

    Raises:
        InputError: there is none.
    """
    number = int(np.abs(frames.times - time).argmin())
    if abs(frames.times[number] - time) > SAME_STAMP_S:
        raise InputError(
            f'{frames.name}: has no map at {time:g} s, where the recording has one; give maps of '
            'the same times'
        )
    return np.asarray(frames.concentration[number], dtype=float)


def _mass_defect(concentration: FloatArray, observed: FloatArray) -> float:
    """Return (sum c - sum c_obs) / sum c_obs over the observed cells; 0 without tracer."""
    known = np.isfinite(observed)
    total = float(observed[known].sum())
    return (float(concentration[known].sum()) - total) / total if total > 0 else 0.0
