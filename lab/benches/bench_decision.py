"""The time from a photograph to its setpoint, beside a camera of 36 megapixels, with all nodes.

The graph is the one of `./porotwin up`. Photographs of the virtual rig are put into its folder as a
camera does it, and their setpoints are waited for.
"""

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lab.benches.crowd import crowd
from porotwin_cli.running.graph_watch import GraphWatch
from porotwin_cli.terminal import WorkFailed, progress, say
from porotwin_cli.workspace import small_rig
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.rig import load_rig, write_rig
from porotwin_core.ros.conversions import seconds_from_msg, time_from_msg
from porotwin_core.ros.ros_environment import claim_domain, prepare_environment
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.launching.graph import GraphSettings, live_graph
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_rig.camera import ASPECT, camera_before
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig

WIDTH_PX = 7600
"""Width of the photographs [px]: 36 megapixels."""

FIRST_PLUME_S = 1500.0
"""Age of the plume in the first photograph [s]: half way to the zone."""

START_S = 180.0
"""Longest time until the first setpoint [s]; it is not counted, because nodes begin then."""

PATIENCE_S = 60.0
"""Longest wait for a later setpoint [s]."""

SAME_TIME_S = 12.0
"""A setpoint belongs to a photograph if their times differ by less [s]: the camera node may take
the seconds in which a photograph is made for a wrong clock, and correct them."""


class Put(NamedTuple):
    """A photograph in the folder: its time [s], and the moment when it lay there [s]."""

    stamp: float
    moment: float


@dataclass
class Arrivals:
    """When setpoints and reports of the hub arrived, by the time of their photograph [s]."""

    setpoints: dict[float, float] = field(default_factory=dict)
    reports: dict[float, Any] = field(default_factory=dict)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def add_setpoint(self, message: Any) -> None:
        """Note a `Setpoint`."""
        with self.changed:
            self.setpoints[time_from_msg(message.header.stamp)] = time.monotonic()
            self.changed.notify_all()

    def add_report(self, message: Any) -> None:
        """Note a `CycleReport`."""
        with self.changed:
            self.reports[time_from_msg(message.header.stamp)] = message
            self.changed.notify_all()

    def of(self, put: Put) -> float | None:
        """Return the time of the setpoint of a photograph [s]; None: there is none with a report.

        The time stands in the message's header.
        """
        near = [
            stamp
            for stamp in self.setpoints.keys() & self.reports.keys()
            if abs(stamp - put.stamp) < SAME_TIME_S
        ]
        return near[0] if near else None

    def wait(self, put: Put, limit: float) -> bool:
        """Return whether the setpoint of a photograph comes within `limit` [s]."""
        with self.changed:
            return self.changed.wait_for(lambda: self.of(put) is not None, limit)


def run(photographs: int = 10, *, programs: int = 0) -> list[dict[str, Any]]:
    """Return a row with the times from `photographs` to their setpoints [s].

    A time begins when the photograph lies complete in the folder. It ends when its setpoint arrives
    at another process. So many idle `programs` of others join the domain after the first setpoint.

    Raises:
        WorkFailed: a node cannot run, or a setpoint does not come.
    """
    prepare_environment()
    with tempfile.TemporaryDirectory() as temporary, claim_domain():
        folder = Path(temporary)
        camera = _Camera(folder / 'photos')
        write_rig(camera.photographer.rig, folder / 'rig.yaml')
        settings = GraphSettings(
            rig=folder / 'rig.yaml',
            photos=camera.folder,
            photo_interval_s=USUAL_PHOTO_INTERVAL_S,
            siblings=True,
            record=folder / 'bag',
            diagnoses=folder / 'diagnoses',
            mend='ask',
            page='127.0.0.1:0',
            page_token=folder / 'token',
        )
        camera.put_baseline()
        arrivals = Arrivals()
        watch = GraphWatch(arrivals.add_report, on_setpoint=arrivals.add_setpoint)
        with watch, GraphProcesses(live_graph(settings), folder, say=say):
            _warm_up(camera, arrivals)
            say(f'{programs} programs join ...')
            with crowd(programs):
                put = list(_put_in_turn(camera, arrivals, photographs))
        return [{'programs beside': programs, **_row(arrivals, put)}]


def _warm_up(camera: '_Camera', arrivals: Arrivals) -> None:
    """Put photographs into the folder until one has led to a setpoint.

    Raises:
        WorkFailed: none does.
    """
    begin = time.monotonic()
    while time.monotonic() - begin < START_S:
        if arrivals.wait(camera.put_next(), USUAL_PHOTO_INTERVAL_S):
            return
    raise WorkFailed(f'no setpoint within {START_S:g} s of the start')


def _put_in_turn(camera: '_Camera', arrivals: Arrivals, count: int) -> Iterator[Put]:
    """Yield photographs that are put into the folder, one in each interval.

    Raises:
        WorkFailed: a setpoint does not come.
    """
    with progress() as bar:
        for _ in bar.track(range(count), description='photographs'):
            begin = time.monotonic()
            put = camera.put_next()
            if not arrivals.wait(put, PATIENCE_S):
                raise WorkFailed(f'no setpoint within {PATIENCE_S:g} s of a photograph')
            yield put
            time.sleep(max(0.0, begin + USUAL_PHOTO_INTERVAL_S - time.monotonic()))


class _Camera:
    """Photographs a virtual rig into a folder.

    Attributes:
        folder: with the photographs.
        photographer: makes them.
    """

    def __init__(self, folder: Path) -> None:
        rig = load_rig(small_rig())
        folder.mkdir()
        self.folder = folder
        say(f'drawing the rig at {WIDTH_PX} px ...')
        self.photographer = Photographer(
            rig, camera=camera_before(rig, WIDTH_PX, round(WIDTH_PX * ASPECT)), seed=1
        )
        self._asset = VirtualRig(rig)
        self._asset.set_rates(Limits.of(rig).safe())
        self._asset.advance(FIRST_PLUME_S)
        self._number = 0

    def put_baseline(self) -> None:
        """Put a photograph without tracer into the folder."""
        self._put(lambda: self.photographer.baseline(time=self._asset.time))

    def put_next(self) -> Put:
        """Put the next photograph into the folder."""
        self._asset.advance(USUAL_PHOTO_INTERVAL_S)
        grid = self._asset.rig.default_grid(0.5 * 0.005)
        signal = signal_seen(self._asset, grid, time=self._asset.time)
        return self._put(lambda: self.photographer.photograph(signal, time=self._asset.time))

    def _put(self, take: Callable[[], bytes]) -> Put:
        """Take a photograph now, and put it into the folder."""
        stamp = datetime.now(UTC)
        self.photographer.start = stamp - timedelta(seconds=self._asset.time)
        content = take()
        part = self.folder / 'photograph.part'
        part.write_bytes(content)
        self._number += 1
        part.replace(self.folder / f'photograph_{self._number:04d}.jpg')
        return Put(stamp.timestamp(), time.monotonic())


def _row(arrivals: Arrivals, photographs: list[Put]) -> dict[str, Any]:
    found = [(put, arrivals.of(put)) for put in photographs]
    pairs = [(put, stamp) for put, stamp in found if stamp is not None]
    seconds = np.array([arrivals.setpoints[stamp] - put.moment for put, stamp in pairs])
    hub = np.array([seconds_from_msg(arrivals.reports[stamp].cycle_duration) for _, stamp in pairs])
    return {
        'megapixels': round(WIDTH_PX * round(WIDTH_PX * ASPECT) / 1e6, 1),
        'photographs': len(pairs),
        'photograph to setpoint, median [s]': round(float(np.median(seconds)), 2),
        'longest [s]': round(float(seconds.max()), 2),
        'of it in the hub, median [s]': round(float(np.median(hub)), 2),
        'hub, longest [s]': round(float(hub.max()), 2),
    }
