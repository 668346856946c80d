"""./porotwin calibrate: the calibration of a camera and rig from a known injection."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from porotwin_cli.terminal import Json, WorkFailed, print_json, refuse_existing, say
from porotwin_core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from porotwin_recording.photos import Photo


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
    from porotwin_imaging.calibration_fit import DilutionPhoto, fit_calibration
    from porotwin_imaging.calibration_pictures import REFUSED, write_fit
    from porotwin_imaging.calibration_trust import CalibrationRefused
    from porotwin_recording.recording import open_recording
    from porotwin_solver.plume_model import plume_model

    target = output or folder.with_name(f'{folder.name}-calibration')
    if not (target / REFUSED).exists():  # a refused calibration may be tried again
        refuse_existing(target)
    recording = open_recording(folder)
    baselines = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    states = [photo for photo in recording.photos if photo.role == 'state']
    if not baselines or not states:
        raise InputError(
            f'{folder}: needs a baseline and state photographs; give their roles in imaging.csv'
        )
    _check_sizes(folder, recording.photos)
    rig, schedule = recording.rig, recording.measured or recording.commanded
    try:
        fit = fit_calibration(
            rig,
            baselines,
            ((photo.time, photo.read()) for photo in states),
            schedule=schedule,
            dilutions=[
                DilutionPhoto(photo.time, photo.read, photo.concentration)
                for photo in recording.photos
                if photo.concentration is not None
            ],
            contrast=contrast,
            plumes=partial(plume_model, rig, schedule) if schedule else None,
            source=folder.name,
            progress=say,
            baseline_names=[
                str(folder / photo.name) for photo in recording.photos if photo.role == 'baseline'
            ],
        )
        if fit.trust.objections:  # a photograph that was left out may be why
            for line in fit.lines:
                say(line)
        say('drawing')
        write_fit(fit, target)
    except CalibrationRefused as refusal:
        seen = f'; see {target / "6_mass.png"}' if (target / REFUSED).exists() else ''
        raise WorkFailed(f'{folder}: {refusal}{seen}') from None
    if as_json:
        print_json({'output': target, 'lines': fit.lines, **fit.calibration.made})
        return
    for line in fit.lines:
        print(line)
    print(f'use it with --calibration {target / "calibration.yaml"}; check the pictures beside it')


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
    from porotwin_imaging.photo_file import photo_size

    try:
        return photo_size(photo.read())
    except InputError as error:
        if photo.role == 'state':  # left out later on
            return 0, 0
        raise InputError(f'{folder / photo.name}: {error}') from None
