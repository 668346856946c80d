"""Pictures of an evaluation: errors over time and maps, as in the paper."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from porotwin_core.basis.errors import writing
from porotwin_core.geometry.grid import Grid, relative_error
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH
from porotwin_costa.evaluation.evaluation import Evaluation, FrameFields

SMALLEST_ERROR = 1e-5
"""Lower end of the logarithmic colour scale [-], far below the camera's noise."""


def write_pictures(evaluation: Evaluation, grid: Grid, folder: Path) -> list[Path]:
    """Write pictures into `folder` and return the files.

    `one_step.png` and `accumulated.png` show the errors over time. `fields_*.png` show the
    observed, predicted and corrected concentration with logarithmic errors (paper, figs. costa-10,
    costa-30, complex-prederr, complex-accerr).
    """
    folder.mkdir(parents=True, exist_ok=True)
    curves = {
        'one_step.png': ('one step ahead', 'predicted', 'corrected'),
        'accumulated.png': ('free-running', 'free_predicted', 'free_corrected'),
    }
    files = [
        _curves(evaluation, folder / name, title, plain, corrected)
        for name, (title, plain, corrected) in curves.items()
    ]
    labels = _labels(evaluation)
    for frame in evaluation.shown:
        path = folder / f'fields_{labels[frame.experiment]}_{frame.time:.0f}s.png'
        files.append(_fields(frame, grid, path))
    return files


def _labels(evaluation: Evaluation) -> dict[str, str]:
    """Return a name for every experiment: its file's, with a number if others have the same."""
    paths = list(dict.fromkeys(frame.experiment for frame in evaluation.frames))
    names = [Path(path).name for path in paths]
    return {
        path: name if names.count(name) == 1 else f'{name}_{number}'
        for number, (path, name) in enumerate(zip(paths, names, strict=True), start=1)
    }


def _curves(evaluation: Evaluation, path: Path, title: str, plain: str, corrected: str) -> Path:
    names = list(dict.fromkeys(frame.experiment for frame in evaluation.frames))
    figure = Figure(figsize=(7, 2.6 * len(names)), layout='constrained')
    axes = np.atleast_1d(np.asarray(figure.subplots(len(names), 1, sharex=True)))
    for axis, name in zip(axes, names, strict=True):
        own = [frame for frame in evaluation.frames if frame.experiment == name]
        minutes = [frame.time / 60 for frame in own]
        axis.plot(minutes, [100 * getattr(f, plain) for f in own], label='physics alone (PBM)')
        axis.plot(minutes, [100 * getattr(f, corrected) for f in own], label='with COSTA')
        axis.set(title=f'{name}, {title}', ylabel='relative error [%]', ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0].legend()
    axes[-1].set_xlabel('time [min]')
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    return path


def _fields(frame: FrameFields, grid: Grid, path: Path) -> Path:
    figure = Figure(figsize=(11, 9), layout='constrained')
    axes = np.asarray(figure.subplots(3, 2))
    extent = (0.0, grid.width, 0.0, grid.height)
    axes[0, 1].axis('off')
    panels = (
        (axes[0, 0], frame.observed, 'observed'),
        (axes[1, 0], frame.predicted, 'predicted, physics alone'),
        (axes[2, 0], frame.corrected, 'corrected with COSTA'),
    )
    for axis, field, title in panels:
        image = axis.imshow(field, origin='lower', extent=extent, vmin=0, vmax=1, cmap='viridis')
        figure.colorbar(image, ax=axis, label='concentration [-]')
        axis.set(title=f'{title}, {frame.time / 60:.1f} min', xlabel='x [m]', ylabel='z [m]')
    for axis, field in ((axes[1, 1], frame.predicted), (axes[2, 1], frame.corrected)):
        error = np.log10(np.maximum(np.abs(field - frame.observed), SMALLEST_ERROR))
        image = axis.imshow(
            error,
            origin='lower',
            extent=extent,
            vmin=np.log10(SMALLEST_ERROR),
            vmax=0,
            cmap='magma',
        )
        figure.colorbar(image, ax=axis, label='log10 |error|')
        relative = 100 * relative_error(field, frame.observed)
        axis.set(title=f'relative error {relative:.2f} %', xlabel='x [m]', ylabel='z [m]')
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    return path
