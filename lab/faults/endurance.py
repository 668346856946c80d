"""The running twin in lock-step with the virtual rig: memory over hours, and nodes that are killed.

One graph serves both. First it runs for hours of simulated time, and the memory of each node is
written down. Then each node is killed at random moments, and each time the twin must set rates
again.
"""

import math
import random
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from porotwin_cli.running.graph_watch import GraphWatch
from porotwin_cli.terminal import WorkFailed, progress, say
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import HOUR_S
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.rig import load_rig, write_rig
from porotwin_core.ros.ros_environment import claim_domain, prepare_environment
from porotwin_hub.launching.graph import GraphSettings, NodeDescription, operator_node, twin_nodes
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_rig.camera import camera_before

ASSET = 'virtual_rig'
"""The node that stands for the rig: it ends with the experiment, and is not killed."""

GRID = '94x56'
PHOTO_WIDTH_PX = 640
EVALUATIONS = 8
"""A light twin: its nodes keep the same data as a heavy one, per photograph."""

START_S = 180.0
"""Longest wall time until the first cycle [s]."""

STALL_S = 120.0
"""Longest wall time for a cycle, and for control after a node was killed [s]."""

LOCK_STEP_S = 10.0
"""Longest wait of the virtual rig for a setpoint [s]; a killed hub sends none."""

SAMPLE_S = 600.0
"""Simulated time between two readings of the memory [s]."""

WARM_S = 3600.0
"""Simulated time until the memory should be steady [s]."""

MOST_GROWTH = 0.01
"""Largest growth of the memory of a node in the second half, as a share. Queues of 1000 messages,
and the rates that a node keeps, fill up in the first."""

NO_SETPOINT = ('no setpoint', 'not taken')
"""Words of the hub's remarks where no setpoint reached the pumps."""

MEGABYTE = 1e6


@dataclass
class LongRun:
    """A running twin, and the reports of its hub."""

    processes: GraphProcesses
    nodes: list[str]
    reports: list[Any] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def add(self, report: Any) -> None:
        """Keep the newest reports."""
        with self.changed:
            self.reports = [*self.reports[-9:], report]
            self.changed.notify_all()

    @property
    def time(self) -> float:
        """Simulated time of the newest report [s]."""
        return float(self.reports[-1].header.stamp.sec) if self.reports else 0.0

    @property
    def last_remark(self) -> str:
        """The last remark of the hub."""
        return next((report.remarks[0] for report in self.reports[::-1] if report.remarks), 'none')

    def wait_until(self, moment: float, *, limit: float, control: bool = False) -> bool:
        """Return whether a report of a time after `moment` [s] comes within `limit` [s].

        `limit` is wall time. With `control` a setpoint must have followed in that cycle.
        """

        def there() -> bool:
            return any(
                report.header.stamp.sec > moment and (_controls(report) or not control)
                for report in self.reports
            )

        with self.changed:
            return self.changed.wait_for(there, limit)

    def memory(self) -> dict[str, float]:
        """Return the memory that each node has for itself [bytes]."""
        found = {}
        for node in self.nodes:
            process = psutil.Process(self.processes.process(node).pid)
            found[node] = float(process.memory_full_info().uss)
        return found


def _controls(report: Any) -> bool:
    """Return whether the twin chose rates in this cycle, and the pumps took them."""
    refused = any(sign in remark for remark in report.remarks for sign in NO_SETPOINT)
    return math.isfinite(report.objective) and not refused


@contextmanager
def long_run(hours: float, seed: int) -> Iterator[LongRun]:
    """Start a twin beside a virtual rig that runs for `hours` of simulated time.

    Raises:
        WorkFailed: there is no first cycle.
    """
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        nodes = _nodes(folder, hours, seed)
        prepare_environment()
        with claim_domain(), GraphProcesses(nodes, folder, say=lambda _: None) as processes:
            run = LongRun(processes, [node.name for node in nodes])
            with GraphWatch(run.add):
                if not run.wait_until(0.0, limit=START_S):
                    raise WorkFailed(f'no cycle within {START_S:g} s of the start')
                yield run


def _nodes(folder: Path, hours: float, seed: int) -> list[NodeDescription]:
    rig = load_rig(small_rig())
    camera = camera_before(rig, PHOTO_WIDTH_PX).description()
    write_rig(rig.model_copy(update={'camera': camera}), folder / 'rig.yaml')
    settings = GraphSettings(
        rig=folder / 'rig.yaml',
        grid=GRID,
        evaluations=EVALUATIONS,
        photo_interval_s=USUAL_PHOTO_INTERVAL_S,
        record=folder / 'bag',
        diagnoses=folder / 'diagnoses',
        page='127.0.0.1:0',
        use_sim_time=True,
    )
    asset = NodeDescription(
        ASSET,
        'porotwin_rig',
        'virtual_rig_node',
        {
            'rig': str(settings.rig),
            'photo_interval_s': USUAL_PHOTO_INTERVAL_S,
            'duration_s': hours * HOUR_S,
            'seed': seed,
            'photo_width_px': PHOTO_WIDTH_PX,
            'lock_step_timeout_s': LOCK_STEP_S,
        },
    )
    return [*twin_nodes(settings), operator_node(settings, asset=False), asset]


Readings = dict[str, list[tuple[float, float]]]
"""Time [s] and memory [bytes] of each node."""


def read_memory(run: LongRun, hours: float) -> Readings:
    """Return the memory of each node over `hours` of simulated time.

    Raises:
        WorkFailed: the twin stalls.
    """
    readings: Readings = {node: [] for node in run.nodes}
    steps = round(hours * HOUR_S / min(SAMPLE_S, hours * HOUR_S / 6.0))
    with progress() as bar:
        for step in bar.track(range(1, steps + 1), description='memory'):
            moment = step * hours * HOUR_S / steps
            while run.time < moment:
                if not run.wait_until(run.time, limit=STALL_S):
                    raise WorkFailed(f'no cycle for {STALL_S:g} s at {run.time:.0f} s')
            for node, memory in run.memory().items():
                readings[node].append((run.time, memory))
    return readings


@dataclass(frozen=True)
class Growth:
    """Memory of a node [bytes]: after the warm-up, at half the time, and at the end."""

    warm: float
    half: float
    end: float

    @property
    def share(self) -> float:
        """Growth after the warm-up, as a share."""
        return self.end / self.warm - 1.0

    @property
    def late_share(self) -> float:
        """Growth in the second half, as a share: what would go on the next day."""
        return self.end / self.half - 1.0


def growth(readings: list[tuple[float, float]]) -> Growth:
    """Return the growth of the memory after the first hour; in a shorter run, after half of it."""
    end_time, end = readings[-1]

    def since(moment: float) -> float:
        return next(memory for time, memory in readings if time >= moment)

    return Growth(since(min(WARM_S, 0.5 * end_time)), since(0.5 * end_time), end)


@dataclass
class Kills:
    """Kills of a node: how many, the times until the twin worked again [s], and how many failed."""

    count: int = 0
    recoveries: list[float] = field(default_factory=list)
    failures: int = 0


def kill_nodes(run: LongRun, count: int, seed: int) -> dict[str, Kills]:
    """Kill each node `count` times at random moments of a cycle; return how the twin went on."""
    draw = random.Random(seed)
    victims = [node for node in run.nodes if node != ASSET]
    order = victims * count
    draw.shuffle(order)
    found = {node: Kills() for node in victims}
    with progress() as bar:
        for node in bar.track(order, description='kills'):
            time.sleep(draw.uniform(0.0, 1.0))  # anywhere in a cycle
            begun, moment = time.monotonic(), run.time
            run.processes.process(node).send_signal(signal.SIGKILL)
            found[node].count += 1
            if run.wait_until(
                moment + USUAL_PHOTO_INTERVAL_S, limit=STALL_S, control=True
            ) and _back(run, node):
                found[node].recoveries.append(time.monotonic() - begun)
            else:
                found[node].failures += 1
                say(
                    f'{node} killed at {moment:.0f} s: no setpoint within {STALL_S:g} s; '
                    f'the last one: {run.last_remark}'
                )
    return found


def _back(run: LongRun, node: str) -> bool:
    """Wait until a node runs again; return whether it does."""
    deadline = time.monotonic() + STALL_S
    while time.monotonic() < deadline:
        if run.processes.running(node):
            return True
        time.sleep(0.1)
    return False
