"""From observed frames to training data: predict every next frame and keep the residual."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_costa.data.dataset import Dataset, empty_dataset
from porotwin_costa.data.frames import Frames, frame_pairs, left_out, rate_vector
from porotwin_costa.data.physics_id import refuse_untaught

PredictFn = Callable[[FloatArray, WellRates, float], FloatArray]
"""(concentration, rates, time step [s]) -> predicted concentration, uncorrected; (nz, nx) [-]."""

ResidualFn = Callable[[FloatArray, FloatArray, WellRates, float], FloatArray]
"""(previous, next, rates, time step [s]) -> exact residual r [1/s] (paper, eq. costa_residual);
maps are (nz, nx)."""


class TrainingSample(NamedTuple):
    """One pair of frames: prediction [-] and residual [1/s], (nz, nx), and what led to them.

    `rates` are the mean rates [m^3/s] by well, `end` [s] is the time of the second frame,
    `experiment` the number of its experiment.
    """

    predicted: FloatArray
    residual: FloatArray
    rates: dict[str, WellRate]
    end: float
    experiment: int


def build_dataset(
    experiments: Iterable[Frames],
    rig: Rig,
    *,
    grid: Grid,
    time_step: float,
    predict: PredictFn,
    residual: ResidualFn,
    preset: str = '',
    progress: Callable[[int], None] = lambda _: None,
) -> Dataset:
    """Return the training data of all experiments.

    For each pair of frames one `time_step` [s] apart: c~^{n+1} = predict(c^n) and
    r^{n+1} = residual(c^n, c^{n+1}), both with the rates of the interval (paper, section 2.2.3).
    Cells that c^n does not show are filled from the last prediction, as in the twin. Cells that
    c^{n+1} does not show have no residual.

    Args:
        experiments: observed maps on `grid`.
        rig: the rig of the physics-based model.
        grid: the grid of all maps.
        time_step: length of an interval [s].
        predict: the physics-based model.
        residual: the residual of the physics-based model.
        preset: numerical scheme of the model; empty if unknown.
        progress: called with the number of samples after each one.

    Raises:
        InputError: a frame is not on `grid`, no pair can be used, or `rig` has levels.
    """
    refuse_untaught(rig)
    dropped: Counter[str] = Counter()
    samples: list[TrainingSample] = []
    names = []
    for frames in experiments:
        if frames.concentration.shape[1:] != grid.shape:
            raise InputError(
                f'{frames.name}: maps of shape {frames.concentration.shape[1:]}, grid {grid} needs '
                f'{grid.shape}; resample them'
            )
        names.append(frames.name)
        first_number = samples[-1].experiment + 1 if samples else 0
        for sample in _samples(frames, time_step, predict, residual, dropped, first_number):
            samples.append(sample)
            progress(len(samples))
    if not samples:
        reasons = left_out(dropped) or 'no frames'
        raise InputError(f'{", ".join(names) or "no recording"}: no pair to learn from ({reasons})')
    return replace(
        with_samples(empty_dataset(rig, grid, time_step, preset), samples),
        dropped=dict(dropped),
        sources=tuple(names),
    )


def with_samples(empty: Dataset, samples: list[TrainingSample]) -> Dataset:
    """Return the data set `empty` with these samples."""

    def stack(values: Iterable[object], like: np.ndarray) -> np.ndarray:
        return np.array(list(values), like.dtype).reshape(len(samples), *like.shape[1:])

    wells = empty.wells
    return replace(
        empty,
        predicted=stack((sample.predicted for sample in samples), empty.predicted),
        rates=stack((rate_vector(sample.rates, wells) for sample in samples), empty.rates),
        residual=stack((sample.residual for sample in samples), empty.residual),
        time=stack((sample.end for sample in samples), empty.time),
        experiment=stack((sample.experiment for sample in samples), empty.experiment),
    )


def _samples(
    frames: Frames,
    time_step: float,
    predict: PredictFn,
    residual: ResidualFn,
    dropped: Counter[str],
    first_number: int,
) -> Iterator[TrainingSample]:
    """Yield a sample for each usable pair; a gap begins the next experiment number."""
    experiment, sequence = first_number - 1, 0
    prediction: FloatArray | None = None
    for pair in frame_pairs(frames, time_step, dropped):
        experiment += not pair.follows
        if pair.sequence != sequence:
            prediction, sequence = None, pair.sequence
        start, end = float(frames.times[pair.number]), float(frames.times[pair.number + 1])
        before = frames.concentration[pair.number].astype(float)
        after = frames.concentration[pair.number + 1].astype(float)
        rates = frames.schedule.mean(start, end)
        before = fill_unseen(before, prediction)
        prediction = predict(before, rates, time_step)
        exact = residual(before, fill_unseen(after, prediction), rates, time_step)
        yield TrainingSample(
            prediction.astype(np.float32),
            np.where(np.isfinite(after), exact, 0.0).astype(np.float32),
            rates,
            end,
            experiment,
        )
