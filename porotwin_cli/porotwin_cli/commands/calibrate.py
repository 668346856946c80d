"""./porotwin calibrate: the calibration of a camera and rig from a known injection."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from porotwin_cli.terminal import Json, WorkFailed, print_json, refuse_existing, say
from porotwin_core.errors import InputError


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

    The folder holds a baseline photograph and some photographs of an injection of tracer stock
    (imaging.csv), and the injected rates (rates.csv), against which the mass in the maps is
    checked. The core of the plume is taken for stock. Photographs of known dilutions (role
    dilution) determine the response.

    A calibration that cannot be trusted is refused: exit status 1, a line with the reasons,
    pictures that show them, and no calibration.yaml.

    Example: ./porotwin calibrate monday --output monday-calibration
    """
    from porotwin_imaging.calibration_fit import DilutionPhoto, fit_calibration
    from porotwin_imaging.calibration_pictures import REFUSED, write_fit
    from porotwin_imaging.calibration_trust import CalibrationRefused
    from porotwin_recording.recording import open_recording

    target = output or folder.with_name(f'{folder.name}-calibration')
    if not (target / REFUSED).exists():  # a refused calibration may be tried again
        refuse_existing(target)
    recording = open_recording(folder)
    baselines = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read()) for photo in recording.photos if photo.role == 'state']
    if not baselines or not states:
        raise InputError(
            f'{folder}: needs a baseline and state photographs; give their roles in imaging.csv'
        )
    try:
        fit = fit_calibration(
            recording.rig,
            baselines,
            states,
            schedule=recording.measured or recording.commanded,
            dilutions=[
                DilutionPhoto(photo.time, photo.read(), photo.concentration)
                for photo in recording.photos
                if photo.concentration is not None
            ],
            contrast=contrast,
            source=folder.name,
            progress=say,
        )
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
