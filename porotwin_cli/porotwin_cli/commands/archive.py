"""./porotwin archive: a run as one file, and back."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json, say
from porotwin_core.basis.errors import InputError

ENDING = '.zip'


def command(
    run: Annotated[
        Path, typer.Argument(help='Folder of a run, recording, or archive to open (.zip).')
    ],
    output: Annotated[
        Path | None,
        typer.Option(help='Archive or folder to write. Default: in the current folder, by name.'),
    ] = None,
    beside: Annotated[
        list[Path] | None,
        typer.Option(
            help='A file or folder that belongs to it, such as a calibration or a report of a '
            'diagnosis. May be given several times.'
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Pack a run into one file for a colleague, or open such a file.

    The archive holds all files of the run: bag, rig, calibration, diagnoses, pictures and logs, and
    the versions of all packages.

    Example: ./porotwin archive runs/monday --beside report --output monday.zip

    Example: ./porotwin archive monday.zip
    """
    if not run.exists():
        raise InputError(f'{run}: no such run; name a folder in runs/, a recording or a .zip')
    if run.suffix == ENDING and run.is_file():
        _open(run, output or Path(run.stem), as_json=as_json)
        return
    from porotwin_recording.experiment.run_archive import write_archive

    for one in beside or []:
        if not one.exists():
            raise InputError(f'--beside {one}: no such file or folder')
    file = output or Path(f'{run.resolve().name}{ENDING}')
    if file.suffix != ENDING:
        raise InputError(f'{file}: an archive is a zip; give a name that ends in {ENDING}')
    count = write_archive(run, file, beside=beside or [])
    size = file.stat().st_size
    if as_json:
        print_json({'output': file, 'files': count, 'size_bytes': size})
    else:
        print(f'{file}: {count} files, {size / 1e6:.3g} MB; ./porotwin archive {file} opens it')


def _open(file: Path, folder: Path, *, as_json: bool) -> None:
    """Unpack an archive, and tell its content."""
    from porotwin_core import __version__
    from porotwin_recording.experiment.catalogue import find_recordings
    from porotwin_recording.experiment.run_archive import open_archive

    told = open_archive(file, folder)
    recordings = list(find_recordings(folder))
    reports = sorted(folder.rglob('report.html'))
    calibrations = sorted(folder.rglob('*calibration*.yaml'))
    version = str(told.get('porotwin', ''))
    if as_json:
        print_json({'output': folder, 'recordings': recordings, 'reports': reports,
                    'calibrations': calibrations, 'porotwin': version})  # fmt: skip
        return
    if version != __version__:
        say(f'{file}: written by PoroTwin {version or "of no version"}; this one is {__version__}')
    for name, paths in (('report', reports), ('calibration', calibrations)):
        for path in paths:
            print(f'{name}: {path}')
    for path in recordings:
        print(f'recording: {path}; ./porotwin check {path} looks at it')
