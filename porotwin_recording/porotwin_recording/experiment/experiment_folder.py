"""The experiment folder: rig.yaml, tables of rates and readings, maps, and photographs."""

import logging
from collections.abc import Callable
from pathlib import Path

from porotwin_checks.all_checks import OF_TABLES, remarks_about
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import IMAGING_FILE
from porotwin_core.rig import Rig, load_rig, read_rig, write_rig
from porotwin_recording.mcap.bag_folder import is_bag
from porotwin_recording.tables.concentration import (
    ConcentrationMaps,
    ConcentrationWriter,
    open_maps,
)
from porotwin_recording.tables.map_files import files_with_maps
from porotwin_recording.tables.observations import read_readings, write_readings
from porotwin_recording.tables.photos import read_photos, write_photos
from porotwin_recording.tables.rates import read_rates, write_rates
from porotwin_recording.tables.recorded_data import RecordedData

LOG = logging.getLogger('porotwin')
"""Receives a warning for everything odd."""

RIG_FILE = 'rig.yaml'
COMMANDED_FILE = 'rates.csv'
MEASURED_FILE = 'rates_measured.csv'
MAPS_FILE = 'concentration.nc'
READINGS_FILE = 'observations.csv'

BEGUN_MAPS_FILE = f'{MAPS_FILE}.partial'
"""The maps while they are written."""

FILES = (RIG_FILE, COMMANDED_FILE, MEASURED_FILE, MAPS_FILE, IMAGING_FILE, READINGS_FILE)
"""All files of an experiment folder; photographs lie where imaging.csv says."""

CAMERA_ENDINGS = ('.jpg', '.jpeg', '.tif', '.tiff')
"""Endings of photographs; pictures of sands and zones are mostly PNG."""

Progress = Callable[[int, int], None]
"""Receives the number of finished maps and photographs, and their total."""

NO_PHOTOGRAPH = (
    f'{IMAGING_FILE} lists no photograph; add a baseline and photographs of the tracer, or remove '
    'the file'
)

HOW_TO_TRY = '; to try a rig.yaml on a recording, copy it there'
"""Remedy for a folder that holds a rig alone, such as that of a diagnosis."""


def is_experiment(path: Path) -> bool:
    """Return whether `path` is an experiment folder; one with a rig.yaml is one also with bags."""
    return path.is_dir() and ((path / RIG_FILE).is_file() or not is_bag(path))


def read_folder(folder: Path, rig: Rig | None = None) -> RecordedData:
    """Return the experiment in `folder`; a given `rig` replaces its rig.yaml.

    Maps and photographs stay on disk until they are read. Odd values are logged as warnings.

    Raises:
        InputError: one line that names the file, the line or value, and the remedy.
    """
    data = folder_data(folder, rig)
    for text in data.remarks:
        LOG.warning('%s: %s', folder, text)
    for remark in remarks_about(data.known(), OF_TABLES):
        if remark.refused:
            raise InputError(f'{folder}: {remark}')
        LOG.warning('%s: %s', folder, remark)
    return data


def folder_data(folder: Path, rig: Rig | None = None) -> RecordedData:
    """Return the experiment in `folder` as `read_folder`, without a judgement on its values.

    Raises:
        InputError: one line that names the file, the line or value, and the remedy.
    """
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder; name an experiment folder')
    replaced = None if rig is None else rig_in(folder)
    if rig is None:
        rig = load_rig(folder)
    commanded, measured = folder / COMMANDED_FILE, folder / MEASURED_FILE
    maps, imaging = folder / MAPS_FILE, folder / IMAGING_FILE
    readings = folder / READINGS_FILE
    if not (commanded.exists() or maps.exists() or imaging.exists()):
        found = files_with_maps(folder)
        rename = f'; if {" or ".join(found)} holds its maps, name it {MAPS_FILE}' if found else ''
        raise InputError(
            f'{folder}: not an experiment folder; it has none of {COMMANDED_FILE}, {MAPS_FILE}, '
            f'{IMAGING_FILE}{rename or HOW_TO_TRY}'
        )
    if not imaging.exists() and (folder / 'photos').is_dir():
        raise InputError(
            f'{folder}: has photos/ but no {IMAGING_FILE}, which gives their times; '
            f'./porotwin import {folder} TARGET makes one from their EXIF times'
        )
    photos = read_photos(folder) if imaging.exists() else ()
    untold = _untold_photographs(folder) if photos or not imaging.exists() else (NO_PHOTOGRAPH,)
    return RecordedData(
        rig,
        commanded=read_rates(commanded, rig.wells) if commanded.exists() else None,
        measured=read_rates(measured, rig.wells) if measured.exists() else None,
        maps=open_maps(maps, rig) if maps.exists() else None,
        photos=photos,
        remarks=(*_unfinished(folder), *untold),
        replaced_rig=replaced,
        readings=read_readings(readings, rig) if readings.exists() else (),
    )


def rig_in(folder: Path) -> Rig | None:
    """Return the rig that `folder` describes; None if it has no description that can be read.

    Its odd values are not logged, because another rig takes its place.
    """
    try:
        return read_rig(folder).rig
    except InputError:
        return None


def is_unfinished(folder: Path) -> bool:
    """Return whether a `folder` has no maps, but the beginning of their file."""
    return not (folder / MAPS_FILE).exists() and (folder / BEGUN_MAPS_FILE).exists()


def _unfinished(folder: Path) -> tuple[str, ...]:
    if not is_unfinished(folder):
        return ()
    return (
        f'{BEGUN_MAPS_FILE} is the beginning of maps that are not complete; wait for the command '
        'that writes them, or run it again',
    )


def _untold_photographs(folder: Path) -> tuple[str, ...]:
    """Return a remark if a folder without maps and imaging.csv holds files of a camera."""
    if (folder / IMAGING_FILE).exists() or (folder / MAPS_FILE).exists():
        return ()
    files = sorted([*folder.glob('*'), *folder.glob('*/*')])
    found = [path for path in files if path.suffix.lower() in CAMERA_ENDINGS]
    if not found:
        return ()
    count = '1 photograph lies' if len(found) == 1 else f'{len(found)} photographs lie'
    return (
        f'{count} here, such as {found[0].relative_to(folder)}, but there is no {IMAGING_FILE} '
        'with their times and roles; they are left out. If they hold the times of the camera, '
        f'./porotwin import {folder} TARGET makes a folder with that list',
    )


def write_folder(folder: Path, data: RecordedData, *, progress: Progress | None = None) -> None:
    """Write `data` as an experiment folder; files are left out where there are no data.

    Maps are written one by one, as float32.

    Raises:
        InputError: the folder already holds an experiment, or a file cannot be written.
    """
    if any((folder / name).exists() for name in FILES):
        raise InputError(f'{folder}: holds an experiment already; name another folder')
    total = len(data.photos) + (len(data.maps) if data.maps is not None else 0)
    report = progress or _ignore
    folder.mkdir(parents=True, exist_ok=True)
    write_rig(data.rig, folder / RIG_FILE)
    if data.commanded is not None and data.commanded.rows:
        write_rates(folder / COMMANDED_FILE, data.commanded)
    if data.measured is not None and data.measured.rows:
        write_rates(folder / MEASURED_FILE, data.measured)
    if data.readings:
        write_readings(folder / READINGS_FILE, data.readings)
    if data.maps is not None:
        _write_maps(folder / MAPS_FILE, data.maps, lambda count: report(count, total))
    if data.photos:
        before = total - len(data.photos)
        write_photos(folder, data.photos, progress=lambda count: report(before + count, total))


def _ignore(*_: int) -> None:
    """Ignore the progress."""


def _write_maps(path: Path, maps: ConcentrationMaps, done: Callable[[int], None]) -> None:
    with ConcentrationWriter(path, maps.grid, origin=maps.origin) as writer:
        frames = zip(maps.times, maps.with_deviations(), strict=True)
        for count, (time, (frame, deviation, systematic)) in enumerate(frames, start=1):
            writer.append(time, frame, deviation=deviation, systematic=systematic)
            done(count)
