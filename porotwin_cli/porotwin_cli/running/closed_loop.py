"""The demo: preparation, closed loop, and the comparison with a run without control."""

import threading
import time
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_cli.pictures.run_pictures import course_picture, plume_picture
from porotwin_cli.recorded.run_account import TrueTracer, read_account, summary
from porotwin_cli.running.graph_watch import GraphWatch
from porotwin_cli.running.hidden_effect import as_text
from porotwin_cli.running.live_mend import MendDesk, accept_all
from porotwin_cli.running.loop_scenario import PRODUCER_DELIVERY
from porotwin_cli.running.mended_loop import mended_figures, mending_lines
from porotwin_cli.running.page_told import tell_page
from porotwin_cli.running.rehearsal import (
    calibration_run,
    injected_tracer,
    producer_of,
    train_costa,
)
from porotwin_cli.terminal import WorkFailed, print_table, progress, say
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.announced_rates import uncontrolled_rates
from porotwin_core.rig import EffectDescription, Rig, load_rig, write_rig
from porotwin_core.rig.control_zones import control_zones
from porotwin_core.ros.ros_environment import claim_domain
from porotwin_hub.launching.graph import (
    GraphSettings,
    NodeDescription,
    Parameters,
    operator_node,
    page_node,
    supervised,
    twin_nodes,
)
from porotwin_hub.launching.node_processes import POLL_S
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_page.address import listen, settled
from porotwin_recording.live.recorder import FLUSH_PERIOD
from porotwin_recording.tables.concentration import open_maps
from porotwin_rig.camera import camera_before
from porotwin_rig.pumps import Pumps
from porotwin_rig.session import parse_speed
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.model import preset_named
from porotwin_solver.model.prediction_cost import prediction_cost

PREPARATION_S = 35.0
"""Calibration of the camera, start of the nodes and pictures of the small rig on two cores [s]."""

PREPARATION = 'the demo, which calibrates the camera and trains COSTA first'
"""The page waits for this before the graph runs."""

TRAINING_S = 50.0
"""Training of COSTA on two cores [s]."""

SECONDS_PER_PHOTOGRAPH = 1.2
"""One photograph, its map, setpoint and forecast of the small rig on two cores [s]."""

MENDED_GRID = '94x56'
"""Columns and rows of the maps where an effect is hidden: cells of 1 cm, so that a diagnosis takes
a minute."""

MENDED_CELLS = 2.0
"""The same for another rig: cells over the usual ones [-]."""

DEMO_CONFIDENCE = 0.7
"""Least confidence of a verdict that the demo accepts [-]: 40 min of photographs seldom make it
surer, and the shadow forecast protects the twin."""

DIAGNOSIS_MINUTES = 10.0
"""Time between two diagnoses [min]: half as long as beside a rig, because the demo is short."""

MENDING_S = 200.0
"""A diagnosis or two, and the runs beside the mended one, on two cores [s]."""

LONGEST_DIAGNOSIS_S = 300.0
"""Longest time that the virtual rig waits for a diagnosis [s]."""


STALL_S = 120.0
"""Longest time without a cycle beside the time between two photographs [s]."""

LAST_REPORT_S = 10.0
"""Longest wait for the report of the last photograph [s]."""


LEAST_TRACER_ML = 0.05
"""Tracer in the zone without control [ml] below which there is nothing to compare with."""

OTHER_MINUTES = 80.0
"""Time under control on another rig whose description tells no end [min], as in the paper."""

LONG_MINUTES = 60.0
"""An experiment of this length [min] shows control from its start; see `start_minute`."""

UNCONTROLLED_MINUTES = 20.0
"""In a shorter experiment the tracer spreads at least so long [min] before the twin takes over.

It then approaches the disallowed zone of the small rig, which it enters after 28 min.
"""

EARLIEST_END = 36.0
"""A shorter experiment ends at the earliest so long after the start of the injection [min].

Without control there are 6 ml of tracer in the zone by then, enough to compare with.
"""


@dataclass(frozen=True)
class DemoSettings:
    """The options of `./porotwin demo`.

    `minutes` is the time under control [min]; `page` the HOST:PORT of the page, empty: no page.
    `hidden` is an effect of the rig that the twin is not told, and finds; None: it looks for none.
    `rig` is the rig with the plan of its pumps; None: the small rig of the paper. `ask` leaves the
    answers to offers to a person.
    """

    minutes: float
    speed: str
    seed: int
    costa: bool
    preset: str
    photo_width: int
    page: str
    hidden: EffectDescription | None = None
    rig: Rig | None = None
    ask: bool = False

    @property
    def start_minute(self) -> float:
        """Time since the start of the injection when the twin takes over [min].

        A short experiment from the start would end before the tracer reaches the zone: its picture
        would show nothing of the control. Another rig is controlled from the start.
        """
        if self.minutes >= LONG_MINUTES or self.rig is not None:
            return 0.0
        return max(UNCONTROLLED_MINUTES, EARLIEST_END - self.minutes)

    @property
    def photographs(self) -> int:
        """Number of photographs under control."""
        return round(self.minutes * 60.0 / USUAL_PHOTO_INTERVAL_S) + 1

    @property
    def patience_s(self) -> float:
        """Longest time without a cycle, before the loop counts as stalled [s]."""
        pace = parse_speed(self.speed)
        between = 0.0 if pace is None else USUAL_PHOTO_INTERVAL_S / pace
        return between + (STALL_S if self.hidden is None else LONGEST_DIAGNOSIS_S)

    def check(self) -> None:
        """Check the options that are text, and the rig.

        Raises:
            InputError: speed, preset or the address of the page is wrong, or the loop cannot run on
                the rig.
        """
        parse_speed(self.speed)
        if self.rig is not None:
            check_rig(self.rig, costa=self.costa)
        preset_named(self.preset)
        if self.page:
            listen(self.page).close()

    def described(self) -> Rig:
        """Return the description that the demo runs: until its end."""
        rig = self.rig or load_rig(small_rig())
        assert rig.control is not None
        control = rig.control.until(self.start_minute + self.minutes)
        return rig.model_copy(update={'control': control})

    def expected_seconds(self) -> float:
        """Return about how long the demo takes on two cores [s]."""
        pace = parse_speed(self.speed)
        work = self._work
        loop = work * self.photographs * SECONDS_PER_PHOTOGRAPH
        if pace is not None:
            loop = max(loop, self.minutes * 60.0 / pace)
        mended = MENDING_S if self.hidden is not None else 0.0
        return work * PREPARATION_S + (TRAINING_S if self.costa else 0.0) + loop + mended

    @property
    def _work(self) -> float:
        """Time of a prediction on the rig over one on the small rig [-]; photographs cost 1."""
        if self.rig is None:
            return 1.0
        own, usual = (
            prediction_cost(
                rig, rig.default_grid(), preset=self.preset, duration=USUAL_PHOTO_INTERVAL_S
            ).seconds
            for rig in (self.rig, load_rig(small_rig()))
        )
        return max(own / usual, 1.0)


def usual_minutes(rig: Rig | None, *, hidden: bool) -> float:
    """Return the usual time under control [min]; `rig` is another one than the small rig."""
    if rig is None:
        return 40.0 if hidden else 30.0
    end = None if rig.control is None else rig.control.end_min
    return OTHER_MINUTES if end is None else end


def check_rig(rig: Rig, *, costa: bool) -> None:
    """Check that the loop can run on `rig`.

    Raises:
        InputError: it has no tracer, no zone to keep free, or COSTA shall be trained for it.
    """
    injected_tracer(rig)
    if not any(zone.kind == 'keep out' for zone in control_zones(rig)):
        raise InputError(
            'control: the demo counts the tracer in a zone to keep out of; give a '
            'disallowed_zone_m, or use ./porotwin rehearse'
        )
    if costa:
        raise InputError(
            'the training experiments of the demo are those of the small rig; leave out --costa, '
            'and use ./porotwin train for your rig'
        )


def run_demo(settings: DemoSettings, folder: Path) -> dict[str, Any]:
    """Run the experiment and return its figures; all files go into `folder`.

    Raises:
        WorkFailed: a node cannot run, or the loop stalls.
    """
    started = time.monotonic()
    with claim_domain():  # before anything is written
        rig_file = _prepare_rig(folder, settings)
        _run_graph(_graph(rig_file, folder, settings), folder, settings)
    figures = _account(load_rig(rig_file), folder, settings.hidden)
    if settings.hidden is not None:
        figures |= mended_figures(load_rig(rig_file), folder, settings.hidden, settings.preset)
    figures['costa'] = settings.costa
    return {**figures, 'duration_s': time.monotonic() - started}


def _graph(rig_file: Path, folder: Path, settings: DemoSettings) -> GraphSettings:
    """Return the settings of the graph, without a calibration and a COSTA model."""
    hidden = settings.hidden is not None
    return GraphSettings(
        rig=rig_file,
        preset=settings.preset,
        photo_interval_s=USUAL_PHOTO_INTERVAL_S,
        record=folder / 'bag',
        page=settled(settings.page) if settings.page else '',
        page_token=folder / 'page_token' if settings.page else None,
        siblings=bool(settings.page) and not hidden,
        grid=_grid(rig_file, settings),
        diagnoses=folder / 'diagnoses' if hidden else None,
        mend='ask' if hidden else 'off',
        use_sim_time=True,
    )


def _grid(rig_file: Path, settings: DemoSettings) -> str:
    """Return columns x rows where an effect is hidden; empty: the usual cells."""
    if settings.hidden is None:
        return ''
    if settings.rig is None:
        return MENDED_GRID
    rig = load_rig(rig_file)
    return str(rig.default_grid(MENDED_CELLS * rig.default_grid().dx))


def _run_graph(graph: GraphSettings, folder: Path, settings: DemoSettings) -> None:
    """Prepare camera and model behind the page, then run the loop.

    Raises:
        WorkFailed: a node cannot run, or the loop stalls.
    """
    with GraphProcesses(_page_from_the_start(graph), folder, say=say) as page:
        tell_page(graph.page, graph.page_token)
        calibration, model = _prepare_camera_and_model(graph.rig, folder, settings)
        _run_loop(replace(graph, calibration=calibration, model=model), folder, settings)
        for why in page.failed.values():
            say(f'the page did not run: {why}')


def _page_from_the_start(graph: GraphSettings) -> list[NodeDescription]:
    """Return the page, which says what is prepared before the other nodes run."""
    return [
        replace(node, parameters={**node.parameters, 'preparation': PREPARATION})
        for node in page_node(graph)
    ]


def _prepare_rig(folder: Path, settings: DemoSettings) -> Path:
    """Write rig.yaml with the corners of the rig in the photographs, and the end of the run."""
    rig = settings.described()
    camera = camera_before(rig, settings.photo_width).description()
    write_rig(rig.model_copy(update={'camera': camera}), folder / 'rig.yaml')
    return folder / 'rig.yaml'


def _prepare_camera_and_model(
    rig_file: Path, folder: Path, settings: DemoSettings
) -> tuple[Path, Path | None]:
    """Return the calibration of the camera and, if chosen, a trained COSTA model."""
    rig = load_rig(rig_file)
    say('calibrating the camera with a known injection ...')
    calibration = calibration_run(rig, folder, seed=settings.seed, photo_width=settings.photo_width)
    if not settings.costa:
        return calibration, None
    say('training COSTA on experiments with other schedules ...')
    return calibration, train_costa(
        rig,
        folder,
        calibration,
        photo_interval=USUAL_PHOTO_INTERVAL_S,
        seed=settings.seed,
        preset=settings.preset,
        photo_width=settings.photo_width,
    )


def _virtual_rig(graph: GraphSettings, folder: Path, settings: DemoSettings) -> NodeDescription:
    """Return the node that stands for the physical asset."""
    hidden: Parameters = {}
    if settings.hidden is not None:
        hidden = {
            'effects': as_text(settings.hidden),
            'wait_for_mend': True,
            'lock_step_timeout_s': LONGEST_DIAGNOSIS_S,
        }
    return NodeDescription(
        'virtual_rig',
        'porotwin_rig',
        'virtual_rig_node',
        {
            **hidden,
            'rig': str(graph.rig),
            'photo_interval_s': graph.photo_interval_s,
            'start_s': settings.start_minute * 60.0,
            'duration_s': (settings.start_minute + settings.minutes) * 60.0,
            'seed': settings.seed,
            'speed': settings.speed,
            'photo_width_px': settings.photo_width,
            'truth': str(folder / 'truth.nc'),
            **({'grid': graph.grid} if graph.grid else {}),
        },
    )


def _run_loop(graph: GraphSettings, folder: Path, settings: DemoSettings) -> None:
    """Start the graph, show its progress, and return after the end of the experiment.

    Raises:
        WorkFailed: a node cannot run, or the loop stalls.
    """
    nodes = supervised(
        [
            *map(_in_lock_step, twin_nodes(replace(graph, page=''))),  # the page runs already
            operator_node(graph, asset=False),
            _virtual_rig(graph, folder, settings),
        ]
    )
    newest = [time.monotonic()]
    reported = threading.Event()
    with progress() as bar:
        task = bar.add_task('closed loop', total=settings.photographs)

        def on_cycle(_: object) -> None:
            newest[0] = time.monotonic()
            bar.advance(task)
            if bar.finished:
                reported.set()

        automatic = settings.hidden is not None and not settings.ask
        operator = MendDesk(accept_all) if automatic else nullcontext()
        shown = ('guard', 'mend', *(('operator',) if settings.ask else ()))
        with (
            operator,
            GraphWatch(on_cycle) as watch,
            GraphProcesses(nodes, folder, say=say, show=shown) as processes,
        ):
            while not watch.finished.wait(POLL_S):
                _check(processes, time.monotonic() - newest[0], settings.patience_s, folder)
            reported.wait(LAST_REPORT_S)  # it follows the setpoint that ends the experiment
            time.sleep(FLUSH_PERIOD)  # for the last messages of the bag


def _in_lock_step(node: NodeDescription) -> NodeDescription:
    """Return a node of the twin that lets the virtual rig wait for a diagnosis."""
    more: dict[str, Parameters] = {
        'mend': {
            'lockstep': True,
            'longest_s': LONGEST_DIAGNOSIS_S,
            'every_min': DIAGNOSIS_MINUTES,
            'least_confidence': DEMO_CONFIDENCE,
        },
        'diagnosis': {'workers': 2},  # the rig waits, so that both cores are free
    }
    return replace(node, parameters={**node.parameters, **more.get(node.name, {})})


def _check(processes: GraphProcesses, silence: float, patience: float, folder: Path) -> None:
    """Raise WorkFailed if a node gave up, or after `silence` [s] without a cycle."""
    refusal = processes.refusal(optional=('supervisor',))
    if refusal is not None:
        raise WorkFailed(refusal)
    if silence > patience:
        raise WorkFailed(f'no cycle for {patience:g} s; see {folder / "log"}')


def _free_run(
    rig: Rig, times: FloatArray, grid: Grid, hidden: EffectDescription | None
) -> FloatArray:
    """Return the tracer of the same virtual rig at `times` [s] without control, (nt, nz, nx).

    The rig has its `hidden` effect there as well.
    """
    effects = [] if hidden is None else [hidden]
    producer = producer_of(rig)
    pumps = Pumps({} if producer is None else {producer: PRODUCER_DELIVERY})
    asset = VirtualRig(rig, effects=effects, pumps=pumps)
    rates = uncontrolled_rates(rig)
    maps = []
    for moment in times:
        for _, end, held in rates.intervals(asset.time, moment):
            asset.set_rates(held)
            asset.advance(end - asset.time)
        maps.append(asset.concentration(grid))
    return np.array(maps)


def _account(rig: Rig, folder: Path, hidden: EffectDescription | None) -> dict[str, Any]:
    """Draw the pictures of the run on a rig with a `hidden` effect, and return its figures."""
    account = read_account(folder / 'bag')
    maps = open_maps(folder / 'truth.nc', rig)
    controlled = TrueTracer(maps.times, maps.grid, maps)
    say('the same experiment without control ...')
    free = TrueTracer(maps.times, maps.grid, _free_run(rig, maps.times, maps.grid, hidden))
    plume_picture(folder / 'plume.png', rig, controlled, free)
    course_picture(folder / 'course.png', rig, account, controlled, free)
    return summary(account, rig, controlled, free)


def show_figures(figures: dict[str, Any], folder: Path) -> None:
    """Print the figures of a run and the places of its files."""
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
            'orders to the pumps',
            figures['orders'],
            f'one after each photograph would be {figures["photographs"]}',
        ),
        (
            'prediction of the next photograph, relative error',
            f'{figures["corrected_error"]:.4f}',
            f'{figures["prediction_error"]:.4f} without COSTA'
            if figures['costa']
            else 'COSTA is off',
        ),
        (
            'the error that the deviations of maps and forecasts predict',
            f'{figures["expected_error"]:.4f}',
            'within' if figures['corrected_error'] <= figures['expected_error'] else 'above',
        ),
        ('photograph to map, relative error', f'{figures["image_error"]:.4f}', 'against the truth'),
        (
            'state to setpoint, median [s]',
            f'{figures["cycle_median_s"]:.2f}',
            f'at most {figures["cycle_longest_s"]:.2f}; photographs every '
            f'{USUAL_PHOTO_INTERVAL_S:g} s',
        ),
        ('photographs', figures['photographs'], f'{figures["remarks"]} remarks in the bag'),
    ]
    print_table('closed loop on the virtual rig', ('', 'with the twin', 'compared with'), rows)
    if figures['disallowed_without_control_ml'] < LEAST_TRACER_ML:
        print('without control no tracer reaches the zone either: take more --minutes')
    for line in mending_lines(figures) if 'hidden_effect' in figures else ():
        print(line)
    print(f'pictures: {", ".join(str(picture) for picture in sorted(folder.glob("*.png")))}')
    print(f'bag: {folder / "bag"} (replay it with ./porotwin replay {folder / "bag"})')
    print(f'duration: {figures["duration_s"]:.0f} s')
