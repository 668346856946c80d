"""A running twin for the fault suite, with a camera folder that the tests write to."""

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
from graph import RunningGraph, running_graph
from rclpy.context import Context
from rclpy.duration import Duration
from set_clock import SetClock

from porotwin_core.rig import load_rig, write_rig
from porotwin_core.ros import conversions
from porotwin_core.ros.node_thread import NodeThread
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.launching.graph import NAMESPACE, GraphSettings, NodeDescription, live_graph
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Photographer

ROOT = Path(__file__).resolve().parents[2]

ENVIRONMENT = dict(os.environ)
"""The environment of processes that a test starts."""

GRID = '31x19'
PHOTO_WIDTH_PX = 640
PHOTO_INTERVAL_S = 30.0
"""Interval that the twin is told [s]; photographs come when a test takes one, and sooner."""

CYCLES = 2
"""Most cycles until a fault shows, and until the twin acts again."""

START_S = 240.0
"""Longest cold start of all nodes on a busy machine [s]."""

RETRY_S = 5.0
"""A photograph without an answer after this time [s] is followed by another one."""

MODEL_TIMEOUT_S = 5.0
"""Longest wait of the hub for a model [s]; its default is longer."""

RESTART_AFTER_S = 12.0
"""Silence after which the supervisor ends a node [s]; its default is longer."""

PATIENCE_S = 2.0
"""Longest wait for an unfinished file [s]; the default is longer."""

STAMP_TOLERANCE_S = 1e-3
"""Difference of a file time and the stamp made of it [s]."""


@dataclass
class Seen:
    """All that the twin said since a moment; see `Stage.since`."""

    stage: 'Stage'
    begun: dict[str, int]

    @property
    def statuses(self) -> list[Any]:
        """The statuses on /diagnostics."""
        arrays = self.stage.graph.messages['/diagnostics'][self.begun['/diagnostics'] :]
        return [status for array in arrays for status in array.status]

    @property
    def remarks(self) -> list[str]:
        """The remarks of the hub's reports, and why forecasts are not corrected."""
        reports = self.stage.graph.messages['hub/cycle'][self.begun['hub/cycle'] :]
        return [text for report in reports for text in (*report.remarks, report.correction_status)]

    @property
    def supervisor(self) -> list[str]:
        """The lines of the supervisor."""
        return self.stage.graph.lines[self.begun['supervisor'] :]

    def log(self, node: str) -> str:
        """Return the log of a node."""
        return self.stage.graph.log(node)[self.begun.get(f'log of {node}', 0) :]


class Stage:
    """A running twin. Every setpoint must follow from a photograph that the stage calls good."""

    def __init__(
        self,
        graph: RunningGraph,
        folder: Path,
        photographer: Photographer,
        domain: int,
        clock: SetClock,
    ) -> None:
        self.graph = graph
        self.clock = clock
        self.domain = domain
        self.folder = folder
        self.photos = folder / 'photos'
        self.limits = Limits.of(photographer.rig)
        self.rig = photographer.rig
        self.healthy = True
        self.writes_exif = True
        """Whether good photographs hold their time; otherwise the file's time is all there is."""
        self.foreign_setpoints: set[int] = set()
        """Numbers of setpoints that a test sent."""
        self._photographer = photographer
        self._count = 0
        self._good: list[float] = []
        self._taken = math.nan
        self.newest = b''
        """The newest good photograph."""

    # --- photographs ------------------------------------------------------------------------

    def picture(self, *, ahead_s: float = 0.0, radius_m: float = 0.04) -> bytes:
        """Return a photograph of this moment: a plume that has grown a little.

        The camera's clock is `ahead_s` [s] ahead; the plume began with `radius_m`.
        """
        self._count += 1
        z, x = np.mgrid[0:0.562:57j, 0:0.934:95j]
        radius = radius_m + 0.0002 * self._count
        self._plume = (np.hypot(x - 0.235, z - 0.235) < radius).astype(float)
        return self.frozen_picture(ahead_s=ahead_s)

    def frozen_picture(self, *, ahead_s: float = 0.0) -> bytes:
        """Return the newest photograph with the time of this moment, `ahead_s` [s] added."""
        moment = float(self._count)
        # the light, the noise and the shake follow the number, the EXIF time this moment
        self._taken = math.floor(1000.0 * time.time()) / 1000.0
        self._photographer.start = datetime.fromtimestamp(self._taken - moment + ahead_s, UTC)
        return self._photographer.photograph(self._plume, time=moment)

    def baseline(self) -> bytes:
        """Return a photograph of this moment without tracer."""
        self._photographer.start = datetime.now(UTC)
        return self._photographer.baseline()

    def put(
        self,
        data: bytes,
        *,
        good: bool,
        taken: float | None = None,
        name: str | None = None,
        folder: Path | None = None,
    ) -> tuple[Path, float]:
        """Write a photograph as a camera does; return its path and its time [s].

        Args:
            data: the file.
            good: whether a setpoint may follow from it.
            taken: its file time [s since 1970]; None: now.
            name: name of the file.
            folder: where; None: the folder that the camera watches.
        """
        taken = time.time() if taken is None else taken
        path = (folder or self.photos) / (
            name or f'IMG_{self._count:04d}_{time.monotonic_ns() % 10**9}.jpg'
        )
        hidden = path.with_name(f'.{path.name}')
        hidden.write_bytes(data)
        written = taken + self.clock.ahead_s
        os.utime(hidden, (written, written))
        hidden.replace(path)
        if good:
            self._good.append(taken)
        return path, taken

    def good_photograph(self, name: bytes | None = None) -> float:
        """Take a photograph that the twin may act on; return its time [s]."""
        self.good_picture(name)
        return self._good[-1]

    def good_picture(self, name: bytes | None = None, *, radius_m: float = 0.04) -> bytes:
        """Take a photograph that the twin may act on; return the file."""
        self.newest = self.picture(radius_m=radius_m)
        if not self.writes_exif:
            self.newest = encoded(decoded(self.newest))
        self.put(self.newest, good=True, taken=self._taken, name=name and os.fsdecode(name))
        return self.newest

    @property
    def newest_good(self) -> float:
        """Time of the newest good photograph [s]."""
        return self._good[-1]

    @property
    def last_but_one_good(self) -> float:
        """Time of the good photograph before it [s]."""
        return self._good[-2]

    # --- the twin's words ----------------------------------------------------------------------

    def since(self) -> Seen:
        """Return everything that the twin says from now on."""
        begun = {name: len(messages) for name, messages in self.graph.messages.items()}
        begun['supervisor'] = len(self.graph.lines)
        for node in self.graph.nodes:
            begun[f'log of {node}'] = len(self.graph.log(node))
        return Seen(self, begun)

    def wait_for(self, purpose: str, condition: Callable[[], bool]) -> None:
        """Return when `condition` holds; fail after two cycles."""
        self.graph.listener.wait_for(purpose, condition, timeout=CYCLES * PHOTO_INTERVAL_S)

    # --- control ---------------------------------------------------------------------------

    def wait_for_control(
        self, *, limit: float = CYCLES * PHOTO_INTERVAL_S, name: bytes | None = None
    ) -> None:
        """Take good photographs until a setpoint follows from one of them.

        Fail after `limit` [s]. `name` is the file name of all of them; None: new names.
        """
        deadline = time.monotonic() + limit
        stamps: list[float] = []
        while time.monotonic() < deadline:
            stamps.append(self.good_photograph(name))
            with suppress(AssertionError):
                self.graph.listener.wait_for(
                    'a setpoint',
                    lambda: any(
                        abs(_taken(message) - stamp) < STAMP_TOLERANCE_S
                        for stamp in stamps
                        for message in self.graph.messages['wells/setpoint'][-10:]
                    ),
                    timeout=RETRY_S,
                )
                return
        raise AssertionError(
            f'no setpoint follows from {len(stamps)} good photographs in {limit:g} s'
        )

    def wait_for_forecast(self) -> None:
        """Take good photographs until the hub has a forecast; fail after two cycles."""
        reports = self.graph.messages['hub/cycle']
        begun, deadline = len(reports), time.monotonic() + CYCLES * PHOTO_INTERVAL_S
        while not any(math.isfinite(report.objective) for report in reports[begun:]):
            assert time.monotonic() < deadline, 'no forecast'
            self.wait_for_control()

    def check_setpoints(self) -> None:
        """Check every setpoint so far: its photograph was good, and it keeps the limits."""
        for message in self.graph.messages['wells/setpoint']:
            if message.sequence in self.foreign_setpoints:
                continue
            stamp = _taken(message)
            assert any(abs(stamp - good) < STAMP_TOLERANCE_S for good in self._good), (
                f'setpoint {message.sequence} follows from the photograph at {stamp:.3f} s'
            )
            assert self.limits.violations(conversions.rates_from_msg(message.wells)) == []

    # --- processes -------------------------------------------------------------------------

    def pid(self, node: str) -> int:
        """Return the process of a node."""
        return self.graph.processes.process(node).pid

    def signal(self, node: str, number: int) -> None:
        """Send a signal to the process of a node."""
        os.kill(self.pid(node), number)

    def now(self) -> float:
        """Return the time [s since 1970]."""
        return time.time()

    @contextmanager
    def foreign(
        self, topic: str, kind: Any, profile: Any, *, name: str = 'stranger'
    ) -> Iterator[Callable[[Any], None]]:
        """Return a function that publishes messages as a node does that is not of the twin.

        At the end of the block that node is gone.
        """
        context = Context()
        rclpy.init(context=context, domain_id=self.domain)
        node = rclpy.create_node(name, namespace=NAMESPACE, context=context)
        publisher = node.create_publisher(kind, topic, profile)
        full_name = node.resolve_topic_name(topic)

        def all_matched() -> bool:
            known = self.graph.listener.node.count_subscribers(full_name)
            return publisher.get_subscription_count() >= known > 0

        try:
            self.wait_for(f'the subscribers of {topic}', all_matched)
            yield publisher.publish
            # a message of a program that leaves at once may be lost on a busy machine
            publisher.wait_for_all_acked(Duration(seconds=RETRY_S))
        finally:
            node.destroy_node()
            rclpy.try_shutdown(context=context)

    @contextmanager
    def foreign_service(
        self, service: Any, name: str, answer: Callable[[Any, Any], Any]
    ) -> Iterator[None]:
        """Offer a service of the twin a second time, as a node that is not of the twin."""
        context = Context()
        rclpy.init(context=context, domain_id=self.domain)
        node = rclpy.create_node('stranger', namespace=NAMESPACE, context=context)
        node.create_service(service, name, answer)
        thread, full_name = NodeThread(node), node.resolve_service_name(name)
        try:
            listener = self.graph.listener.node
            self.wait_for(f'both {name}', lambda: listener.count_services(full_name) > 1)
            yield
        finally:
            thread.end()

    def call(self, service: Any, name: str, request: Any) -> Any:
        """Return the answer of a service of the twin."""
        node = self.graph.listener.node
        client = node.create_client(service, name)
        try:
            self.wait_for(f'the service {name}', client.service_is_ready)
            future = client.call_async(request)
            self.wait_for(f'an answer of {name}', future.done)
            return future.result()
        finally:
            node.destroy_client(client)

    def call_and_leave(self, service: Any, name: str, request: Any) -> None:
        """Call a service of the twin as a node that is gone before the answer."""
        context = Context()
        rclpy.init(context=context, domain_id=self.domain)
        node = rclpy.create_node('stranger', namespace=NAMESPACE, context=context)
        client = node.create_client(service, name)
        try:
            self.wait_for(f'the service {name}', client.service_is_ready)
            client.call_async(request)
        finally:
            node.destroy_node()
            rclpy.try_shutdown(context=context)


def kill(stage: Stage, node: str, number: int = signal.SIGKILL) -> None:
    """Kill a node, or ask it to end, and wait until another process runs in its place."""
    before = stage.pid(node)
    stage.signal(node, number)
    stage.wait_for(f'another process of {node}', lambda: stage.pid(node) != before)


def decoded(jpeg: bytes) -> np.ndarray:
    """Return the pixels of a photograph."""
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))


def encoded(pixels: np.ndarray) -> bytes:
    """Return a photograph without EXIF data."""
    return bytes(cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes())


def _taken(message: Any) -> float:
    return conversions.time_from_msg(message.header.stamp)


def _nodes(folder: Path) -> list[NodeDescription]:
    settings = GraphSettings(
        rig=folder / 'rig.yaml',
        photos=folder / 'photos',
        grid=GRID,
        evaluations=4,
        photo_interval_s=PHOTO_INTERVAL_S,
        record=folder / 'bag',
        page='127.0.0.1:0',
        page_token=folder / 'page_token',
    )
    more: dict[str, dict[str, Any]] = {
        'camera': {'patience': PATIENCE_S},
        'hub': {'model_timeout_s': MODEL_TIMEOUT_S},
        'supervisor': {'restart_after_s': RESTART_AFTER_S},
        'imaging': {'longest_gap': 3600.0},  # photographs come when a test takes one
    }
    return [
        replace(node, parameters={**node.parameters, **more.get(node.name, {})})
        for node in live_graph(settings)
    ]


@contextmanager
def running_stage(folder: Path, domain: int, *, settable: bool = False) -> Iterator[Stage]:
    """Start a twin and take photographs until it sets rates; a `settable` one has its own clock."""
    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    photographer = Photographer(rig, camera=camera_before(rig, PHOTO_WIDTH_PX), seed=3)
    (folder / 'photos').mkdir(parents=True)
    write_rig(photographer.rig, folder / 'rig.yaml')
    clock = SetClock(folder)
    environment = clock.environment if settable else {}
    with running_graph(_nodes(folder), folder / 'run', domain, environment) as graph:
        stage = Stage(graph, folder, photographer, domain, clock)
        stage.put(stage.baseline(), good=False, name='IMG_0000.jpg')
        graph.wait_for_log('imaging', 'baseline:', timeout=START_S)
        stage.wait_for_control(limit=START_S)
        yield stage
