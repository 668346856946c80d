"""What the correction earns: errors per frame with and without it, one step ahead and free-running.

One step: predict and correct from the observed frame n, compare with frame n + 1. Free-running: the
model goes on from its own answers, starting at the first frame of an uninterrupted sequence; the
corrected run takes its own corrected states as the next start (paper, section 3.2, accumulated
error). The uncorrected model always runs beside the corrected one.
"""

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, fill_unseen
from porotwin_core.wells import WellRates
from porotwin_costa.dataset import (
    TIME_STEP_TOLERANCE,
    Frames,
    PredictFn,
    enough_seen,
    mean_rates,
)
from porotwin_costa.model import APPLIED, Correction

CorrectFn = Callable[[FloatArray, FloatArray, WellRates, float], FloatArray]
"""(previous, sigma [1/s], rates, time_step [s]) -> corrected concentration."""

AssessFn = Callable[[FloatArray, WellRates], Correction]
"""(predicted, rates) -> corrective source term and its status."""


@dataclass(frozen=True)
class FrameErrors:
    """Errors of one predicted frame, all relative to the observed one: ||c - c_obs|| / ||c_obs||.

    `time` [s] and `experiment` name the observed frame. Mass defects are
    (sum c - sum c_obs) / sum c_obs of the one-step predictions. Cells that were not observed do not
    count.
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
class Snapshot:
    """Fields (nz, nx) of one frame, for a picture like the paper's figures of COSTA results."""

    experiment: str
    time: float
    observed: FloatArray
    predicted: FloatArray
    corrected: FloatArray


@dataclass(frozen=True)
class Evaluation:
    """All frames, and snapshots of those asked for."""

    frames: tuple[FrameErrors, ...]
    snapshots: tuple[Snapshot, ...]

    def mean(self, name: str) -> float:
        """Return the mean of a column of `FrameErrors` over all frames."""
        return float(np.mean([getattr(frame, name) for frame in self.frames]))

    def table(self) -> str:
        """Return a short table: mean errors, and the last of the free-running ones."""
        lines = [f'{"experiment":26} frames   one step: PBM   COSTA   free-run: PBM   COSTA']
        for name in dict.fromkeys(frame.experiment for frame in self.frames):
            own = Evaluation(tuple(f for f in self.frames if f.experiment == name), ())
            lines.append(
                f'{name[-26:]:26} {len(own.frames):6d}   {own.mean("predicted"):13.4f}'
                f' {own.mean("corrected"):7.4f}   {own.frames[-1].free_predicted:13.4f}'
                f' {own.frames[-1].free_corrected:7.4f}'
            )
        withheld = [frame.status for frame in self.frames if frame.status != APPLIED]
        if withheld:
            count = f'{len(withheld)} of {len(self.frames)} frames'
            lines.append(f'no correction in {count}, first because: {withheld[0]}')
        return '\n'.join(lines)

    def write_csv(self, path: Path) -> None:
        """Write one row per frame."""
        with path.open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            names = [item.name for item in fields(FrameErrors)]
            writer.writerow(names)
            writer.writerows([getattr(frame, name) for name in names] for frame in self.frames)


def relative_error(concentration: FloatArray, observed: FloatArray) -> float:
    """Return ||c - c_obs|| / ||c_obs|| over the observed cells; the norm itself without tracer."""
    known = np.isfinite(observed)
    size = float(np.linalg.norm(observed[known]))
    difference = float(np.linalg.norm(concentration[known] - observed[known]))
    return difference / size if size > 0 else difference


def _mass_defect(concentration: FloatArray, observed: FloatArray) -> float:
    known = np.isfinite(observed)
    total = float(observed[known].sum())
    return (float(concentration[known].sum()) - total) / total if total > 0 else 0.0


def evaluate(
    experiments: Iterable[Frames],
    *,
    time_step: float,
    predict: PredictFn,
    correct: CorrectFn,
    assess: AssessFn,
    snapshot_times: Sequence[float] = (600.0, 1800.0),
    progress: Callable[[int], None] = lambda _: None,
) -> Evaluation:
    """Return the errors of every frame that follows another by `time_step` [s].

    Cells that a frame does not show are as in the last corrected prediction before it, as in the
    twin. The free run starts again after an interruption, a gap or a frame with too little seen.
    Snapshots are those at `snapshot_times` [s], 10 and 30 minutes as in the paper.

    Raises:
        InputError: no frame can be judged.
    """
    frames: list[FrameErrors] = []
    snapshots: list[Snapshot] = []
    names = []

    def step(start: FloatArray, rates: WellRates) -> tuple[FloatArray, FloatArray, str]:
        predicted = predict(start, rates, time_step)
        answer = assess(predicted, rates)
        corrected = predicted
        if answer.applied:
            # as in the twin: the correction may overshoot, a concentration cannot
            corrected = np.clip(correct(start, answer.sigma, rates, time_step), 0.0, 1.0)
        return predicted, corrected, answer.status

    for experiment in experiments:
        names.append(experiment.name)
        free: tuple[FloatArray, FloatArray] | None = None
        prediction: FloatArray | None = None
        times = experiment.times
        for n in range(len(times) - 1):
            before = np.asarray(experiment.concentration[n], dtype=float)
            observed = np.asarray(experiment.concentration[n + 1], dtype=float)
            clean = any(times[n] < moment <= times[n + 1] for moment in experiment.clean_times)
            apart = not math.isclose(
                times[n + 1] - times[n], time_step, rel_tol=TIME_STEP_TOLERANCE
            )
            if clean or apart or not (enough_seen(before) and enough_seen(observed)):
                free = None
                prediction = None if clean else prediction
                continue
            before = fill_unseen(before, prediction)
            rates = mean_rates(experiment.schedule, float(times[n]), float(times[n + 1]))
            predicted, corrected, status = step(before, rates)
            prediction = corrected
            free_start = free or (before, before)
            free_predicted = predict(free_start[0], rates, time_step)
            _, free_corrected, free_status = step(free_start[1], rates)
            free = free_predicted, free_corrected
            frames.append(
                FrameErrors(
                    experiment=experiment.name,
                    time=float(times[n + 1]),
                    predicted=relative_error(predicted, observed),
                    corrected=relative_error(corrected, observed),
                    free_predicted=relative_error(free_predicted, observed),
                    free_corrected=relative_error(free_corrected, observed),
                    predicted_mass=_mass_defect(predicted, observed),
                    corrected_mass=_mass_defect(corrected, observed),
                    status=status,
                    free_status=free_status,
                )
            )
            if any(abs(times[n + 1] - wanted) < time_step / 2 for wanted in snapshot_times):
                snapshots.append(
                    Snapshot(experiment.name, float(times[n + 1]), observed, predicted, corrected)
                )
            progress(len(frames))
    if not frames:
        raise InputError(
            f'{", ".join(names) or "no recording"}: no two known frames {time_step:g} s apart'
        )
    return Evaluation(tuple(frames), tuple(snapshots))
