"""./porotwin up: the twin beside the rig, until stopped."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json
from porotwin_cli.workspace import run_folder
from porotwin_core.errors import InputError
from porotwin_hub.graph import GraphSettings


def command(
    rig: Annotated[Path, typer.Option(help='rig.yaml, or a folder with one.')],
    photos: Annotated[Path | None, typer.Option(help='Folder to watch for photographs.')] = None,
    camera: Annotated[str, typer.Option(help='Camera device, such as /dev/video0.')] = '',
    replay: Annotated[
        bool, typer.Option('--replay', help='Photographs and time come from ./porotwin replay.')
    ] = False,
    page: Annotated[str, typer.Option(help='HOST:PORT of the page. Empty: no page.')] = (
        '127.0.0.1:8765'
    ),
    grid: Annotated[
        str, typer.Option(help='Columns x rows, such as 187x112. Default: cells of 5 mm.')
    ] = '',
    preset: Annotated[
        str, typer.Option(help='Preset of the physics-based model: fast, accurate or upwind.')
    ] = 'fast',
    calibration: Annotated[Path | None, typer.Option(help='Calibration of the camera.')] = None,
    model: Annotated[Path | None, typer.Option(help='COSTA model to start with.')] = None,
    retrain_every: Annotated[
        int, typer.Option(help='Retrain COSTA after so many new states. 0: never.', min=0)
    ] = 0,
    architecture: Annotated[
        str,
        typer.Option(help="Network to retrain, such as local. Default: the loaded model's."),
    ] = '',
    photo_interval_s: Annotated[
        float, typer.Option(help='Time between photographs [s].', min=0.1)
    ] = 30.0,
    horizon_s: Annotated[
        float, typer.Option(help='Horizon of the optimiser [s].', min=1.0)
    ] = 600.0,
    speak: Annotated[bool, typer.Option(help='Speak setpoints with espeak-ng.')] = False,
    predict_only: Annotated[bool, typer.Option(help='Never choose setpoints.')] = False,
    diagnosis: Annotated[
        bool, typer.Option(help='Offer diagnoses of the run so far: ./porotwin diagnose --live.')
    ] = True,
    output: Annotated[
        Path | None, typer.Option(help='Folder for bag, logs and training. Default: in runs/.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Start the twin beside the rig.

    It turns photographs into maps, predictions and setpoints, and records everything. It runs until
    Ctrl-C.

    Example: ./porotwin up --rig rig.yaml --photos /mnt/camera --page 0.0.0.0:8765
    """
    from porotwin_cli.grids import grid_of
    from porotwin_cli.live_twin import check_early, run_until_stopped
    from porotwin_core.rig import load_rig

    rig_file = rig / 'rig.yaml' if rig.is_dir() else rig
    description = load_rig(rig_file)
    if [photos is not None, bool(camera), replay].count(True) != 1:
        raise InputError('name either --photos FOLDER or --camera DEVICE, or --replay for a bag')
    if photos is not None and not photos.is_dir():
        raise InputError(f'{photos}: no such folder of photographs; create it or name another')
    if description.camera is None:
        raise InputError(f'{rig_file}: has no camera section; imaging needs its corners_px')
    cells = grid_of(grid, description)
    check_early(description, cells, preset, calibration, model, architecture, page)
    folder = run_folder(output, 'up')
    settings = GraphSettings(
        rig=rig_file.resolve(),
        photos=photos.resolve() if photos is not None else None,
        device=camera,
        calibration=calibration,
        model=model,
        grid=grid,
        preset=preset,
        photo_interval_s=photo_interval_s,
        horizon_s=horizon_s,
        control=not predict_only,
        retrain_every=retrain_every,
        architecture=architecture,
        training=folder / 'training' if retrain_every else None,
        record=folder / 'bag',
        diagnoses=folder / 'diagnoses' if diagnosis else None,
        page=page,
        speak=speak,
        use_sim_time=replay,
    )
    run_until_stopped(settings, folder)
    if as_json:
        print_json({'output': folder, 'bag': settings.record, 'logs': folder / 'log'})
    else:
        print(f'recorded in {settings.record}')
