"""./porotwin calibrate: from a known injection to a camera that can be believed."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, refuse_existing, say
from porotwin_core.errors import InputError


def command(
    folder: Annotated[
        Path, typer.Argument(help='Experiment folder or bag: photographs of an injection.')
    ],
    output: Annotated[
        Path | None, typer.Option(help='Folder; default: FOLDER-calibration.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a camera and rig from photographs of a known injection, with pictures of each step.

    The folder holds a baseline photograph, some photographs of growing tracer (imaging.csv), and
    what the pumps injected (rates.csv; without it the strongest signal is taken for stock).

    Example: ./porotwin calibrate monday --output monday-calibration
    """
    from porotwin_imaging.calibrate import calibrate
    from porotwin_recording.recording import open_recording

    target = output or folder.with_name(f'{folder.name}-calibration')
    refuse_existing(target)
    recording = open_recording(folder)
    baselines = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read()) for photo in recording.photos if photo.role == 'state']
    if not baselines or not states:
        raise InputError(
            f'{folder}: needs a baseline and state photographs; give their roles in imaging.csv'
        )
    result = calibrate(
        recording.rig,
        baselines,
        states,
        schedule=recording.measured or recording.commanded,
        output=target,
        source=folder.name,
        progress=say,
    )
    if as_json:
        print_json({'output': target, 'lines': result.lines, **result.calibration.made})
        return
    for line in result.lines:
        print(line)
    print(
        f'use it with --calibration {target / "calibration.yaml"}; look at the pictures beside it'
    )
