"""./porotwin export: a bag into an experiment folder, or a recording into a dataset."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from porotwin_cli.conversion import convert
from porotwin_cli.terminal import Json, print_json, progress, say
from porotwin_core.errors import InputError


def command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    folder: Annotated[Path, typer.Argument(help='Experiment folder or dataset to write.')],
    kind: Annotated[
        Literal['folder', 'zarr', 'netcdf'],
        typer.Option(
            '--format',
            help='folder: an experiment folder. zarr, netcdf: maps and rates for xarray; here the '
            'source may be an experiment folder as well.',
        ),
    ] = 'folder',
    segment: Annotated[
        int | None,
        typer.Option(help='Which experiment, if the bag holds several. Default: the longest.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Convert an MCAP bag into an experiment folder, or a recording into a dataset for notebooks.

    The folder holds the data of the experiment. The command lists the topics that it leaves out.

    Example: ./porotwin export bags/sample sample_experiment

    Example: ./porotwin export bags/sample sample.zarr --format zarr
    """
    from porotwin_recording.bag_conversion import export_bag, topics_left_out
    from porotwin_recording.experiment_folder import RIG_FILE

    if bag.suffix == '.nc':
        raise InputError(
            f'{bag}: is a file of maps already; xarray.open_dataset opens it, and '
            './porotwin measure makes a table of it'
        )
    if kind != 'folder':
        _export_dataset(bag, folder, kind, segment, as_json=as_json)
        return
    if (bag / RIG_FILE).is_file():
        raise InputError(
            f'{bag}: is an experiment folder already; copy it, or give --format zarr or netcdf'
        )
    convert(partial(export_bag, segment=segment), bag, folder, as_json=as_json)
    left_out = topics_left_out(bag)
    if left_out:
        counts = ', '.join(f'{name} ({count})' for name, count in left_out.items())
        say(f'left out, because a folder has no place for them: {counts}')


def _export_dataset(
    source: Path,
    target: Path,
    kind: Literal['zarr', 'netcdf'],
    segment: int | None,
    *,
    as_json: bool,
) -> None:
    """Write maps and rates of a recording for xarray, and print their number."""
    from porotwin_recording.dataset_export import export_dataset
    from porotwin_recording.recording import open_recording

    recording = open_recording(source, segment=segment)
    with progress() as bar:
        task = bar.add_task('maps', total=None)
        export_dataset(
            recording,
            target,
            kind,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    maps = len(recording.times)
    if as_json:
        print_json({'output': target, 'format': kind, 'maps': maps})
    else:
        print(f'{target}: {maps} maps; open it with xarray.open_{_OPENERS[kind]}')


_OPENERS = {'zarr': 'zarr', 'netcdf': 'dataset'}
