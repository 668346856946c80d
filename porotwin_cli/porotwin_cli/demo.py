"""./porotwin demo: the paper's control experiment in a closed loop on a virtual rig."""

import os
import threading
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from porotwin_cli.output import (
    Json,
    WorkFailed,
    print_json,
    print_table,
    progress,
    say,
)
from porotwin_cli.workspace import run_folder, small_rig
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig, load_rig, write_rig
from porotwin_hub.control import Limits
from porotwin_hub.graph import GraphSettings, NodeDescription, operator_node, twin_nodes
from porotwin_hub.processes import GraphProcesses

PHOTO_INTERVAL_S = 30.0
PRODUCER_DELIVERY = 0.99
"""What the producer's pump delivers of what it is told (paper, section 4)."""

STALL_S = 120.0
"""No cycle for so long means that the graph stands still."""

LAST_REPORT_S = 10.0
"""Longest wait for the report of the last photograph."""


def command(
    minutes: Annotated[float, typer.Option(help='Length of the experiment.', min=1.0)] = 80.0,
    speed: Annotated[
        str, typer.Option(help="'max', or how many times faster than the laboratory.")
    ] = 'max',
    seed: Annotated[int, typer.Option(help='Of the sand, the camera and the training.')] = 7,
    costa: Annotated[
        bool, typer.Option(help='Train COSTA on other experiments first, and use it.')
    ] = True,
    preset: Annotated[
        str,
        typer.Option(
            help='Physics-based model: fast, or upwind, too diffusive as the paper has it.'
        ),
    ] = 'upwind',
    photo_width: Annotated[int, typer.Option(help='Of the photographs [px].', min=400)] = 1600,
    page: Annotated[bool, typer.Option(help='Serve a page to watch.')] = True,
    output: Annotated[Path | None, typer.Option(help='Folder for everything it makes.')] = None,
    as_json: Json = False,
) -> None:
    """Run the paper's section 4: steer a plume away from a zone, twin against virtual rig.

    Every node runs in a process of its own; the virtual rig waits for the twin (lock-step), so the
    result does not depend on the speed of the machine. Everything is recorded into a bag.

    Example: ./porotwin demo --minutes 20
    """
    from porotwin_rig.session import parse_speed
    from porotwin_solver.model import preset_named

    parse_speed(speed)
    preset_named(preset)
    started = time.monotonic()
    folder = run_folder(output, 'demo')
    say(f'demo: {minutes:g} min of the small rig, into {folder}')
    rig_file = _prepare_rig(folder, photo_width)
    calibration, model = _prepare_camera_and_model(
        rig_file, folder, seed=seed, costa=costa, preset=preset, photo_width=photo_width
    )
    settings = GraphSettings(
        rig=rig_file,
        calibration=calibration,
        model=model,
        preset=preset,
        photo_interval_s=PHOTO_INTERVAL_S,
        record=folder / 'bag',
        page='127.0.0.1:8765' if page else '',
        use_sim_time=True,
    )
    _run_loop(settings, folder, minutes=minutes, speed=speed, seed=seed, photo_width=photo_width)
    figures = _account(load_rig(rig_file), folder)
    figures['duration_s'] = time.monotonic() - started
    _show(figures, folder, as_json)


def _prepare_rig(folder: Path, photo_width: int) -> Path:
    """Write rig.yaml with the place of the rig in the virtual camera's photographs."""
    from porotwin_rig.camera import camera_before

    rig = load_rig(small_rig())
    camera = camera_before(rig, photo_width).description()
    rig = rig.model_copy(update={'camera': camera})
    write_rig(rig, folder / 'rig.yaml')
    return folder / 'rig.yaml'


def _prepare_camera_and_model(
    rig_file: Path, folder: Path, *, seed: int, costa: bool, preset: str, photo_width: int
) -> tuple[Path, Path | None]:
    """Return the calibration of the camera and, when asked for, a trained COSTA model."""
    from porotwin_cli.rehearsal import calibration_run, train_costa

    rig = load_rig(rig_file)
    say('calibrating the camera with a known injection ...')
    calibration = calibration_run(rig, folder, seed=seed, photo_width=photo_width)
    if not costa:
        return calibration, None
    say('training COSTA on experiments with other schedules ...')
    return calibration, train_costa(
        rig,
        folder,
        calibration,
        photo_interval=PHOTO_INTERVAL_S,
        seed=seed,
        preset=preset,
        photo_width=photo_width,
    )


def _run_loop(
    settings: GraphSettings,
    folder: Path,
    *,
    minutes: float,
    speed: str,
    seed: int,
    photo_width: int,
) -> None:
    """Start the graph, show its progress, and return when the experiment is over.

    Raises:
        WorkFailed: a node cannot run, or the loop stands still.
    """
    from porotwin_cli.watch import GraphWatch

    asset = NodeDescription(
        'virtual_rig',
        'porotwin_rig',
        'virtual_rig_node',
        {
            'rig': str(settings.rig),
            'photo_interval_s': settings.photo_interval_s,
            'duration_s': minutes * 60.0,
            'seed': seed,
            'speed': speed,
            'photo_width_px': photo_width,
            'truth': str(folder / 'truth.nc'),
        },
    )
    nodes = [*twin_nodes(settings), operator_node(settings, asset=False), asset]
    photographs = round(minutes * 60.0 / settings.photo_interval_s) + 1
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    # two demos on one machine must not hear each other
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    newest = [time.monotonic()]
    reported = threading.Event()
    with progress() as bar:
        task = bar.add_task('closed loop', total=photographs)

        def on_cycle(_: object) -> None:
            newest[0] = time.monotonic()
            bar.advance(task)
            if bar.finished:
                reported.set()

        with GraphWatch(on_cycle) as watch, GraphProcesses(nodes, folder, say=say) as graph:
            if settings.page:
                say(f'page: http://{settings.page}')
            while not watch.finished.wait(0.5):
                failed = {name: why for name, why in graph.failed.items() if name != 'page'}
                if failed:
                    name, why = next(iter(failed.items()))
                    raise WorkFailed(f'{name} cannot run: {why}')
                if time.monotonic() - newest[0] > STALL_S:
                    raise WorkFailed(f'no cycle for {STALL_S:g} s; see {folder / "log"}')
            reported.wait(LAST_REPORT_S)  # it follows the setpoint that ends the experiment
            time.sleep(1.0)  # let the recorder write what is still on its way


def _free_run(rig: Rig, times: FloatArray, grid: Grid) -> FloatArray:
    """Return what the same virtual rig shows at `times` when nobody controls it, (nt, nz, nx)."""
    from porotwin_rig.pumps import Pumps
    from porotwin_rig.virtual_rig import VirtualRig

    asset = VirtualRig(rig, pumps=Pumps({'producer': PRODUCER_DELIVERY}))
    asset.set_rates(Limits.of(rig).safe())
    maps = []
    for moment in times:
        if moment > asset.time:
            asset.advance(moment - asset.time)
        maps.append(asset.concentration(grid))
    return np.array(maps)


def _account(rig: Rig, folder: Path) -> dict[str, Any]:
    """Return the figures of the run, after drawing its pictures."""
    from porotwin_cli.account import Truth, read_account, summary
    from porotwin_cli.pictures import course_picture, plume_picture
    from porotwin_recording.concentration import open_maps

    account = read_account(folder / 'bag')
    maps = open_maps(folder / 'truth.nc', rig)
    controlled = Truth(maps.times, maps.grid, maps)
    say('the same experiment without control ...')
    free = Truth(maps.times, maps.grid, _free_run(rig, maps.times, maps.grid))
    plume_picture(folder / 'plume.png', rig, controlled, free)
    course_picture(folder / 'course.png', rig, account, controlled, free)
    return summary(account, rig, controlled, free)


def _show(figures: dict[str, Any], folder: Path, as_json: bool) -> None:
    if as_json:
        print_json({**figures, 'output': folder})
        return
    rows = [
        (
            'tracer in the disallowed zone at the end [ml]',
            f'{figures["disallowed_ml"]:.1f}',
            f'{figures["disallowed_without_control_ml"]:.1f} without control',
        ),
        (
            'dose: tracer in the zone over time [ml min]',
            f'{figures["dose_ml_min"]:.0f}',
            f'{figures["dose_without_control_ml_min"]:.0f} without control',
        ),
        (
            'prediction of the next photograph, relative error',
            f'{figures["corrected_error"]:.4f}',
            f'{figures["prediction_error"]:.4f} without COSTA',
        ),
        ('photograph to map, relative error', f'{figures["image_error"]:.4f}', 'against the truth'),
        (
            'state to setpoint, median [s]',
            f'{figures["cycle_median_s"]:.2f}',
            f'{figures["cycle_longest_s"]:.2f} at most, of {PHOTO_INTERVAL_S:g}',
        ),
        ('photographs', figures['photographs'], f'{figures["remarks"]} remarks in the bag'),
    ]
    print_table('closed loop on the virtual rig', ('', 'with the twin', 'beside it'), rows)
    print(f'pictures: {folder / "plume.png"}, {folder / "course.png"}')
    print(f'bag: {folder / "bag"} (replay it with ./porotwin replay {folder / "bag"})')
    print(f'took {figures["duration_s"]:.0f} s')
