"""From recordings to what COSTA learns from: the one place where it meets the solver."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from porotwin_cli.output import progress
from porotwin_core.grid import Grid, conservative_resample
from porotwin_core.rig import Rig
from porotwin_costa.dataset import Dataset, Frames, build_dataset
from porotwin_recording.recording import Recording, open_recording
from porotwin_solver.model import Model


def source_name(recording: Recording) -> str:
    """Return the name that a model keeps of a recording it learned from."""
    return str(recording.source.resolve())


def frames_of(recording: Recording, grid: Grid) -> Frames:
    """Return the maps of a recording on `grid`, with the rates that were measured, else told."""
    maps = [conservative_resample(values, grid.shape) for values in recording.maps or ()]
    return Frames(
        times=np.asarray(recording.times),
        concentration=np.array(maps),
        schedule=recording.delivered,
        name=source_name(recording),
    )


def open_all(paths: Sequence[Path], rig: Rig | None) -> list[Recording]:
    """Return the recordings at `paths`, believed to be of `rig` or, without, as each says."""
    return [open_recording(path, rig=rig) for path in paths]


def dataset_of(
    experiments: Sequence[Frames], rig: Rig, *, grid: Grid, time_step: float, preset: str
) -> Dataset:
    """Return the training pairs of all experiments, with progress.

    Raises:
        InputError: no pair of frames is `time_step` [s] apart.
    """
    model = Model(rig, grid, preset=preset)
    total = sum(len(frames.times) - 1 for frames in experiments)
    with progress() as bar:
        task = bar.add_task('training pairs', total=total)
        return build_dataset(
            experiments,
            rig,
            grid=grid,
            time_step=time_step,
            predict=model.predict,
            residual=model.residual,
            preset=preset,
            progress=lambda count: bar.update(task, completed=count),
        )
