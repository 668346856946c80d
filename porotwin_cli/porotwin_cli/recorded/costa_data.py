"""Training of COSTA from recordings: the one place where it meets the solver."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_cli.recorded.given_twice import refuse_twice
from porotwin_cli.recorded.missing_physics import missing_physics
from porotwin_cli.terminal import progress
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import crew
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import Judge, kept_runs
from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.data.frames import Frames, resampled
from porotwin_costa.evaluation.learnt_account import gap_shares
from porotwin_costa.networks import Architecture
from porotwin_costa.training.run_training import (
    Experiments,
    SayFn,
    TrainingChoice,
    train_from_runs,
)
from porotwin_costa.training.training import TrainingProgress, train
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.tables.concentration import ConcentrationMaps, open_maps
from porotwin_solver.adjoint.learnt_coefficients import LearntModels
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.presets import IMPLICIT

PRECISE_PRESET = 'accurate'
"""Scheme that learnt physics runs with where free runs gain enough. The paper's implicit model
keeps its own."""


def source_name(recording: Recording) -> str:
    """Return the name under which a model remembers a recording that it learned from."""
    return str(recording.source.resolve())


def frames_of(recording: Recording, grid: Grid) -> Frames:
    """Return the maps of a recording on `grid`, with the measured rates or else the commanded."""
    maps = recording.maps
    return resampled(
        Frames(
            times=np.asarray(recording.times),
            concentration=recording.concentration,
            schedule=recording.delivered,
            deviation=None if maps is None or maps.deviation is None else maps.deviation[:],
            name=source_name(recording),
        ),
        grid,
    )


def recording_of(frames: Frames, rig: Rig) -> Recording:
    """Return the recording of maps in memory, for experiments on the virtual rig."""
    nz, nx = frames.concentration.shape[1:]

    def series(values: FloatArray) -> ConcentrationMaps:
        kept, times = values.astype(np.float32), np.asarray(frames.times, dtype=np.float64)
        return ConcentrationMaps(times, rig.grid(nx, nz), lambda start, stop: kept[start:stop])

    maps = series(frames.concentration)
    if frames.deviation is not None:
        maps = replace(maps, deviation=series(frames.deviation))
    return Recording(source=Path(frames.name), rig=rig, commanded=frames.schedule, maps=maps)


def references_of(
    paths: Sequence[Path], recordings: Sequence[Recording], grid: Grid
) -> list[Frames]:
    """Return the better maps at `paths` on `grid`, one file for each of the `recordings`; or none.

    Raises:
        InputError: there is a file too few or too many, or one cannot be read.
    """
    if paths and len(paths) != len(recordings):
        raise InputError(
            f'--reference: {len(paths)} files for {len(recordings)} recordings; give one for each, '
            'in their order'
        )
    found = []
    for path, recording in zip(paths, recordings, strict=False):
        maps = open_maps(path, recording.rig)
        values = np.asarray(maps[:], dtype=float)
        found.append(resampled(Frames(maps.times, values, Schedule(), name=str(path)), grid))
    return found


def open_all(paths: Sequence[Path], rig: Rig | None) -> list[Recording]:
    """Return the recordings at `paths`, with `rig` or, if None, the rig of each recording.

    Raises:
        InputError: one of them is no recording, has no maps, or is named twice.
    """
    recordings = [open_recording(path, rig=rig) for path in paths]
    refuse_twice(recordings)
    return recordings


@dataclass(frozen=True)
class CorrectedModel:
    """The physics-based model that COSTA corrects; it can be sent to other processes.

    Attributes:
        rig: its rig.
        grid: the grid of all maps.
        preset: its numerical scheme.
        time_step: time between the maps of a pair [s].
    """

    rig: Rig
    grid: Grid
    preset: str
    time_step: float

    def __call__(self, grid: Grid) -> LearntModels:
        """Return the solver on `grid`."""
        return LearntModels(self.rig, grid, self.preset)


def dataset_of(experiments: Sequence[Frames], corrected: CorrectedModel) -> Dataset:
    """Return the training pairs of all experiments, on the model's grid, with a progress display.

    Raises:
        InputError: no pair of frames is a time step apart.
    """
    model = corrected(corrected.grid).model(LearntPhysics())
    total = sum(len(frames.times) - 1 for frames in experiments)
    with progress() as bar:
        task = bar.add_task('training pairs', total=total)
        return build_dataset(
            experiments,
            corrected.rig,
            grid=corrected.grid,
            time_step=corrected.time_step,
            predict=model.predict,
            residual=model.residual,
            preset=corrected.preset,
            progress=lambda count: bar.update(task, completed=count),
        )


def train_on_runs(
    recordings: Sequence[Recording],
    corrected: CorrectedModel,
    choice: TrainingChoice,
    *,
    workers: int | None = None,
    scheduler: str = '',
) -> CorrectiveModel:
    """Return a model trained on single steps and through free runs, with a progress display.

    Args:
        recordings: the recordings to learn from.
        corrected: the model to correct.
        choice: how to train.
        workers: simulations at a time, as in `porotwin_core.basis.parallel.crew`.
        scheduler: address of a Dask scheduler whose workers do them instead, likewise.

    Raises:
        InputError: too few maps, or the model cannot run.
    """
    with crew(workers=workers, scheduler=scheduler, threads=True) as pool, progress() as bar:
        task = bar.add_task('training COSTA', total=None)

        def missing(learning: Sequence[Frames], say: SayFn) -> Sequence[EffectDescription]:
            names = {frames.name for frames in learning}
            shown = [one for one in recordings if source_name(one) in names]
            return missing_physics(
                shown,
                crew=pool,
                say=say,
                progress=lambda stage, share: bar.update(
                    task, total=100, completed=round(100 * share), description=stage
                ),
            )

        data = Experiments(
            corrected.rig,
            corrected.grid,
            [frames_of(recording, corrected.grid) for recording in recordings],
            corrected.time_step,
            corrected.preset,
            corrected,
            missing,
            pool,
            '' if corrected.preset in (IMPLICIT, PRECISE_PRESET) else PRECISE_PRESET,
        )
        return train_from_runs(
            data,
            choice,
            progress=lambda state: bar.update(
                task, total=state.epochs, completed=state.epoch, description='training the network'
            ),
            say=bar.console.print,
        )


def account_of(
    model: CorrectiveModel, experiments: Sequence[Frames], bare: Rig, corrected: CorrectedModel
) -> dict[str, Any]:
    """Return the account of a training in words of physics: learnt effects, `gap_shares`.

    Args:
        model: the trained model.
        experiments: the maps that it was trained on.
        bare: the rig without the effects that were named.
        corrected: the model to correct.

    Raises:
        InputError: the model cannot run.
    """
    _, kept = kept_runs(experiments, model.architecture.training.validation_share)
    judge = Judge(corrected(model.grid), kept, model.time_step)
    without = judge
    if bare != corrected.rig:
        without = Judge(replace(corrected, rig=bare)(model.grid), kept, model.time_step)
    shares = gap_shares(without, judge, model)
    parts = ', '.join(f'{name} {percent(share)}' for name, share in shares.items() if share)
    learnt = () if model.learnt is None else model.learnt.effects
    return {
        'gap_shares': shares,
        'says': [
            *(f'learnt {EFFECTS[one.name].change_in_words(one.parameters)}' for one in learnt),
            f'squared gap of the kept free runs: {parts}',
        ],
    }


def train_with_progress(
    dataset: Dataset, architecture: Architecture, *, epochs: int = 0, seed: int
) -> CorrectiveModel:
    """Return a trained model, with a progress display; `epochs` 0 keeps the usual number.

    Raises:
        InputError: the data set is too small, or the training diverged.
    """
    settings = architecture.training.with_epochs(epochs)
    with progress() as bar:
        task = bar.add_task('training COSTA', total=settings.epochs)

        def on_epoch(state: TrainingProgress) -> None:
            text = f'training COSTA, loss {state.validation_loss:.3f}'
            bar.update(task, completed=state.epoch, description=text)

        return train(dataset, architecture, settings, seed=seed, progress=on_epoch)
