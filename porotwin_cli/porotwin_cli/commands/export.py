"""./porotwin export: a bag into an experiment folder, a recording into a dataset or a part."""

import math
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from porotwin_cli.options.experiment_times import times_in
from porotwin_cli.recorded.conversion import convert
from porotwin_cli.terminal import Json, print_json, progress, say
from porotwin_core.basis.errors import InputError


def command(
    bag: Annotated[
        Path, typer.Argument(help='MCAP file, bag folder, or experiment folder to cut.')
    ],
    folder: Annotated[Path, typer.Argument(help='Experiment folder or dataset to write.')],
    kind: Annotated[
        Literal['folder', 'zarr', 'netcdf', 'vtk'],
        typer.Option(
            '--format',
            help='folder: an experiment folder. zarr, netcdf: maps and rates for xarray; here the '
            'source may be an experiment folder as well. vtk: maps for ParaView.',
        ),
    ] = 'folder',
    segment: Annotated[
        int | None,
        typer.Option(help='Which experiment, if the bag holds several. Default: the longest.'),
    ] = None,
    times: Annotated[
        str,
        typer.Option(
            help='START:END [s]: only the maps and photographs between these times, in an '
            'experiment folder. START: and :END leave one end open. Rates before them stay.'
        ),
    ] = '',
    as_json: Json = False,
) -> None:
    """Convert an MCAP bag into an experiment folder, or a recording into a dataset for notebooks.

    The folder holds the data of the experiment. The command lists the topics that it leaves out.
    With --times it cuts a part out of a bag or of an experiment folder.

    Example: ./porotwin export bags/sample sample_experiment

    Example: ./porotwin export experiment morning --times 0:7200

    Example: ./porotwin export bags/sample sample.zarr --format zarr

    Example: ./porotwin export bags/sample sample_vtk --format vtk
    """
    from porotwin_recording.experiment.bag_conversion import export_bag, topics_left_out
    from porotwin_recording.experiment.experiment_folder import RIG_FILE

    if bag.suffix == '.nc':
        raise InputError(
            f'{bag}: is a file of maps already; xarray.open_dataset opens it, and '
            './porotwin measure makes a table of it'
        )
    span = _span(times) if times else None
    if kind != 'folder':
        if span is not None:
            raise InputError(f'--times {times}: cuts experiment folders; leave out --format {kind}')
        _export_dataset(bag, folder, kind, segment, as_json=as_json)
        return
    if bag.name == RIG_FILE and bag.is_file():  # its folder is meant
        bag = bag.parent
    is_folder = (bag / RIG_FILE).is_file()
    if is_folder and span is None:
        raise InputError(
            f'{bag}: is an experiment folder already; copy it, cut it with --times, or give '
            '--format zarr, netcdf or vtk'
        )
    convert(partial(export_bag, segment=segment, times=span), bag, folder, as_json=as_json)
    left_out = {} if is_folder else topics_left_out(bag)
    if left_out:
        counts = ', '.join(f'{name} ({count})' for name, count in left_out.items())
        say(f'left out, because a folder has no place for them: {counts}')


def _span(text: str) -> tuple[float, float]:
    """Return the times START and END [s]; infinite where an end is open.

    Raises:
        InputError: the text is no such pair.
    """
    first, _, last = text.partition(':')
    start, end = times_in(f'{first.strip() or 0}:{last.strip() or 0}', 2)
    both_open = not (first.strip() or last.strip())
    if both_open or ':' not in text or not math.isfinite(start + end):
        raise InputError(
            f"--times '{text}': write START:END in seconds, like 0:7200, 1800: or :7200"
        )
    start = start if first.strip() else -math.inf
    end = end if last.strip() else math.inf
    if not start < end:
        raise InputError(
            f"--times '{text}': END lies before START; write the earlier time first"
            if end < start
            else f"--times '{text}': END is START; write a later END"
        )
    return start, end


def _export_dataset(
    source: Path,
    target: Path,
    kind: Literal['zarr', 'netcdf', 'vtk'],
    segment: int | None,
    *,
    as_json: bool,
) -> None:
    """Write a recording for xarray or ParaView, and print the number of its maps."""
    from porotwin_recording.experiment.dataset_export import export_dataset
    from porotwin_recording.experiment.recording import open_recording
    from porotwin_recording.experiment.vtk_export import export_vtk

    recording = open_recording(source, segment=segment)
    with progress() as bar:
        task = bar.add_task('maps', total=None)
        if kind == 'vtk':
            export_vtk(recording, target)
        else:
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
        print(f'{target}: {maps} maps; open it with {_OPENERS[kind]}')


_OPENERS = {
    'zarr': 'xarray.open_zarr',
    'netcdf': 'xarray.open_dataset',
    'vtk': 'ParaView: maps.pvd',
}
