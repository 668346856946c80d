"""./porotwin calibrate: the calibration of a camera and rig from a known injection."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from porotwin_cli.terminal import Json, WorkFailed, print_json, refuse_existing, say
from porotwin_core.basis.errors import InputError, check_writable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from porotwin_core.rates.wells import Schedule
    from porotwin_imaging.calibrating.calibration_fit import CalibrationFit
    from porotwin_recording.experiment.recording import Recording
    from porotwin_recording.tables.photos import Photo


def command(
    folder: Annotated[
        Path, typer.Argument(help='Experiment folder or bag: photographs of an injection.')
    ],
    output: Annotated[
        Path | None, typer.Option(help='Folder; default: FOLDER-calibration.')
    ] = None,
    contrast: Annotated[
        Literal['absorbance', 'difference'] | None,
        typer.Option(help='Signal of the tracer; default: the one that the colours prefer.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a camera and rig from photographs of a known injection, with pictures of each step.

    The folder holds a baseline photograph, some photographs of an injection of tracer stock
    (imaging.csv), and the injected rates (rates.csv). The core of the plume counts as stock. A
    comparison of plume fronts with the model gives the response and the blur of the camera. The
    rates check the mass in the maps. Photographs of known dilutions (role dilution) improve the
    response.

    An untrustworthy calibration is refused: exit status 1, a line with the reasons, pictures that
    show them, and no calibration.yaml.

    Example: ./porotwin calibrate monday --output monday-calibration
    """
    from porotwin_checks.all_checks import OF_MAPS, OF_PHOTOGRAPHS, OF_RIG, remarks_about
    from porotwin_cli.photographs.seen_photos import SeenPhotos
    from porotwin_recording.experiment.recording import odd_lines, open_recording
    from porotwin_recording.tables.one_writer import only_writer

    _refuse_other_files(folder)
    target = output or _beside(folder)
    _refuse_complete(target)
    recording = open_recording(folder)
    for line in odd_lines([recording], OF_MAPS | OF_RIG):
        say(line)
    seen = SeenPhotos().of(recording.photos)
    for remark in remarks_about(replace(recording.known(), seen_photos=seen), OF_PHOTOGRAPHS):
        say(f'{folder}: {remark}')
    _check_photos(recording)
    with only_writer(target):
        _refuse_complete(target)  # another call may have ended just now
        fit = _calibrated(recording, target, contrast)
    if as_json:
        print_json({'output': target, 'lines': fit.lines, **fit.calibration.made})
        return
    for line in fit.lines:
        print(line)
    print(f'use it with --calibration {target / "calibration.yaml"}; check the pictures beside it')


def _refuse_other_files(folder: Path) -> None:
    """Raise InputError if `folder` is a file, and neither a bag nor the rig.yaml of a folder."""
    from porotwin_recording.experiment.experiment_folder import RIG_FILE

    if folder.is_file() and folder.name != RIG_FILE and folder.suffix != '.mcap':
        raise InputError(f'{folder}: is no recording; name an experiment folder or an MCAP bag')


def _beside(folder: Path) -> Path:
    """Return the default output for the recording `folder`: a folder beside it.

    Raises:
        InputError: `folder` is the root of the disk.
    """
    from porotwin_recording.experiment.experiment_folder import RIG_FILE

    if folder.name == RIG_FILE and folder.is_file():  # its folder is meant
        folder = folder.parent
    if folder.name in ('', '..'):
        folder = folder.resolve()
    if not folder.name:
        raise InputError(f'{folder}: has no folder beside it; name one with --output')
    return folder.with_name(f'{folder.name}-calibration')


def _refuse_complete(target: Path) -> None:
    """Raise InputError if `target` exists, but for a refused calibration, which is tried again."""
    from porotwin_imaging.calibrating.calibration_pictures import REFUSED

    if (target / REFUSED).exists():
        check_writable(target)
    else:
        refuse_existing(target)


def _check_photos(recording: 'Recording') -> None:
    """Raise InputError unless there are a baseline and state photographs, all of one size."""
    roles = {photo.role for photo in recording.photos}
    if not {'baseline', 'state'} <= roles:
        raise InputError(
            f'{recording.source}: needs a baseline and state photographs; give their roles in '
            'imaging.csv'
        )
    _check_sizes(recording.source, recording.photos)


def _calibrated(
    recording: 'Recording', target: Path, contrast: Literal['absorbance', 'difference'] | None
) -> 'CalibrationFit':
    """Return the calibration of `recording`, written to the folder `target`.

    Raises:
        InputError: the photographs or rates are wrong, or `target` may not be written.
        WorkFailed: the calibration cannot be trusted.
    """
    from porotwin_imaging.calibrating.calibration_fit import (
        DilutionPhoto,
        InjectionSource,
        fit_calibration,
    )
    from porotwin_imaging.calibrating.calibration_pictures import write_fit
    from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
    from porotwin_solver.effects import tracer_storage
    from porotwin_solver.model.plume_model import plume_model

    rig, photos = recording.rig, recording.photos
    schedule, rates_file = _injected_rates(recording)
    states = [photo for photo in photos if photo.role == 'state']
    try:
        fit = fit_calibration(
            rig,
            [photo.read() for photo in photos if photo.role == 'baseline'],
            ((photo.time, photo.read()) for photo in states),
            schedule=recording.known().rates,
            dilutions=[
                DilutionPhoto(photo.time, photo.read, photo.concentration)
                for photo in photos
                if photo.concentration is not None
            ],
            contrast=contrast,
            plumes=partial(plume_model, rig, schedule) if schedule else None,
            source=InjectionSource(recording.source.resolve().name, rates_file),
            storage=partial(tracer_storage, rig),
            progress=say,
            baseline_names=[
                str(recording.source / photo.name) for photo in photos if photo.role == 'baseline'
            ],
            samples=[photo.read for photo in states],
        )
        say('drawing')
        write_fit(fit, target)
    except CalibrationRefused as refusal:
        for line in refusal.lines:  # a photograph that was left out may be why
            say(line)
        seen = f'; see {refusal.picture}' if refusal.picture else ''
        raise WorkFailed(f'{recording.source}: {refusal}{seen}') from None
    return fit


def _injected_rates(recording: 'Recording') -> 'tuple[Schedule | None, str]':
    """Return the delivered rates, None if there are none, and the file that holds them.

    The commanded rates count before the first measurement.
    """
    from porotwin_recording.experiment.experiment_folder import COMMANDED_FILE, MEASURED_FILE

    measured = recording.measured is not None and bool(recording.measured.rows)
    return recording.known_rates, MEASURED_FILE if measured else COMMANDED_FILE


def _check_sizes(folder: Path, photos: 'Sequence[Photo]') -> None:
    """Check that the photographs have the size of the first baseline.

    A state photograph of another size is left out later on; one of them must fit.

    Raises:
        InputError: a baseline or dilution, or every state photograph, has another size.
    """
    sizes = {photo.name: _size(folder, photo) for photo in photos if photo.role != 'state'}
    first = next(photo.name for photo in photos if photo.role == 'baseline')
    states = {photo.name: _size(folder, photo) for photo in photos if photo.role == 'state'}
    if sizes[first] not in states.values():
        sizes |= states
    for name, size in sizes.items():
        if size != sizes[first]:
            raise InputError(
                f'{folder / name}: photograph of {size[0]} x {size[1]} px, the baseline {first} '
                f'has {sizes[first][0]} x {sizes[first][1]} px; use photographs of one camera '
                'as it wrote them'
            )


def _size(folder: Path, photo: 'Photo') -> tuple[int, int]:
    """Return (width, height) of a photograph [px]; raise InputError with its name if it is none."""
    from porotwin_imaging.photograph.photo_file import photo_size

    try:
        return photo_size(photo.read())
    except InputError as error:
        if photo.role == 'state':  # left out later on
            return 0, 0
        raise InputError(f'{folder / photo.name}: {error}') from None
