"""./porotwin up: the twin beside the rig, until stopped."""

import os
import signal
import threading
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, say
from porotwin_cli.workspace import run_folder
from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig, load_rig
from porotwin_hub.graph import GraphSettings, description_of, live_graph
from porotwin_hub.objective_registry import make_objective
from porotwin_hub.processes import GraphProcesses

NEEDED = ('imaging', 'solver', 'hub', 'camera')
"""Without one of these the twin does nothing."""


def command(
    rig: Annotated[Path, typer.Option(help=description_of('rig'))],
    photos: Annotated[Path | None, typer.Option(help=description_of('photos'))] = None,
    camera: Annotated[str, typer.Option(help=description_of('camera'))] = GraphSettings.camera,
    replay: Annotated[
        bool, typer.Option('--replay', help='Photographs and time from ./porotwin replay.')
    ] = False,
    page: Annotated[str, typer.Option(help=description_of('page'))] = ('127.0.0.1:8765'),
    grid: Annotated[str, typer.Option(help=description_of('grid'))] = GraphSettings.grid,
    preset: Annotated[str, typer.Option(help=description_of('preset'))] = GraphSettings.preset,
    calibration: Annotated[Path | None, typer.Option(help=description_of('calibration'))] = None,
    model: Annotated[Path | None, typer.Option(help=description_of('model'))] = None,
    retrain_every: Annotated[
        int, typer.Option(help=description_of('retrain_every'), min=0)
    ] = GraphSettings.retrain_every,
    photo_interval_s: Annotated[
        float, typer.Option(help=description_of('photo_interval_s'), min=0.1)
    ] = GraphSettings.photo_interval_s,
    horizon_s: Annotated[
        float, typer.Option(help=description_of('horizon_s'), min=1.0)
    ] = GraphSettings.horizon_s,
    speak: Annotated[bool, typer.Option(help=description_of('speak'))] = GraphSettings.speak,
    predict_only: Annotated[bool, typer.Option(help='Never choose setpoints.')] = False,
    diagnosis: Annotated[
        bool, typer.Option(help='Offer a diagnosis of the run so far: ./porotwin diagnose --live.')
    ] = True,
    output: Annotated[Path | None, typer.Option(help='Folder for bag and logs.')] = None,
    as_json: Json = False,
) -> None:
    """Start the twin: photographs in, maps, predictions and setpoints out, everything recorded.

    Example: ./porotwin up --rig rig.yaml --photos /mnt/camera --page 0.0.0.0:8765
    """
    rig_file = rig / 'rig.yaml' if rig.is_dir() else rig
    description = load_rig(rig_file)
    if [photos is not None, bool(camera), replay].count(True) != 1:
        raise InputError('name either --photos FOLDER or --camera DEVICE, or --replay for a bag')
    if photos is not None and not photos.is_dir():
        raise InputError(f'{photos}: no such folder of photographs; create it or name another')
    if description.camera is None:
        raise InputError(f'{rig_file}: has no camera section; imaging needs its corners_px')
    on = (
        Grid.parse(grid, description.width_m, description.height_m)
        if grid
        else description.default_grid()
    )
    _refuse_early(description, on, preset, calibration, model, page)
    if camera:
        _refuse_unknown_source(camera)
    folder = run_folder(output, 'up')
    settings = GraphSettings(
        rig=rig_file.resolve(),
        photos=photos.resolve() if photos is not None else None,
        camera=camera,
        calibration=calibration,
        model=model,
        grid=grid,
        preset=preset,
        photo_interval_s=photo_interval_s,
        horizon_s=horizon_s,
        control=not predict_only,
        retrain_every=retrain_every,
        record=folder / 'bag',
        diagnoses=folder / 'diagnoses' if diagnosis else None,
        page=page,
        speak=speak,
        use_sim_time=replay,
    )
    _run(settings, folder)
    if as_json:
        print_json({'output': folder, 'bag': settings.record, 'logs': folder / 'log'})
    else:
        print(f'recorded in {settings.record}')


def _refuse_early(
    rig: Rig, grid: Grid, preset: str, calibration: Path | None, model: Path | None, page: str
) -> None:
    """Ask of each argument what its node will ask, before any node starts.

    Raises:
        InputError: an argument that a node would refuse.
    """
    from porotwin_costa.model import CorrectiveModel
    from porotwin_imaging.calibration import load_calibration
    from porotwin_page.address import listen
    from porotwin_solver.presets import preset_named

    preset_named(preset)
    if rig.control is not None:
        make_objective(rig, grid)
    if calibration is not None:
        load_calibration(calibration)
    if model is not None:
        learned = CorrectiveModel.load(model).for_physics(rig, grid, preset)
        if learned.doubt:
            say(f'{model}: {learned.doubt}')
    if page:
        listen(page).close()


def _refuse_unknown_source(camera: str) -> None:
    """Raise InputError if there is no camera source of this name."""
    from porotwin_imaging.sources.source_registry import source_at

    source_at(camera)


def _run(settings: GraphSettings, folder: Path) -> None:
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())  # the graph takes it for other ends too
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    source = settings.photos or settings.camera or './porotwin replay'
    say(f'twin of {settings.rig}, photographs from {source}')
    if settings.page:
        say(f'page: http://{settings.page}')
    say(f'recording into {settings.record}, logs in {folder / "log"}; stop with Ctrl-C')
    with GraphProcesses(live_graph(settings), folder, say=say, show=('operator',)) as graph:
        while not stop.wait(0.5):
            lost = [name for name in NEEDED if name in graph.failed]
            if lost:
                raise InputError(f'{lost[0]} cannot run: {graph.failed[lost[0]]}')
    say('stopped')
