"""A mock camera for tests: publishes photographs of a folder, with faults on request."""

import array
import threading
import time
from pathlib import Path
from typing import Any

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import PHOTO_SUFFIXES
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node import TwinNode, declare, run
from porotwin_recording.tables.photos import read_photos
from porotwin_rig.faults import FAULTS, parse_faults

SETTLE_S = 4.0
"""Wait after subscribers and nodes are there [s]: DDS may match their side of the connection later.
Fast DDS repeats an announcement that a busy machine lost after 3 s."""


class MockCameraNode(TwinNode):
    """Publishes a baseline, waits for a subscriber, publishes one photograph per period, and ends.

    In an experiment folder, imaging.csv gives times and roles. In a plain folder the first
    photograph by name is the baseline, and the others follow `interval_s` apart.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and find the photographs.

        Raises:
            InputError: a parameter is wrong, or there are no photographs.
        """
        super().__init__('mock_camera', **kwargs)
        folder = Path(declare(self, 'photos', '', 'experiment folder, or folder of photographs'))
        interval = float(
            declare(self, 'interval_s', 30.0, 'time between photographs of a plain folder [s]')
        )
        self._period = float(declare(self, 'period_s', 1.0, 'wall time between photographs [s]'))
        faults = declare(self, 'faults', '', 'faults as NUMBER:FAULT,...; states count from 0')
        self._patience = float(
            declare(self, 'startup_timeout_s', 60.0, 'longest wait for a subscriber [s]')
        )
        self._faults = parse_faults(faults)
        self._baselines, self._states = _photographs(folder, interval)
        self._clock_topic = self.create_publisher(Clock, '/clock', 10)
        self._baseline = self.create_publisher(
            CompressedImage, 'camera/baseline/compressed', qos.BASELINE
        )
        self._photo = self.create_publisher(CompressedImage, 'camera/image/compressed', qos.PHOTO)
        threading.Thread(target=self._work, daemon=True).start()

    def _work(self) -> None:
        for stamp, path in self._baselines:
            self._publish(self._baseline, stamp, path.read_bytes())
        deadline = time.monotonic() + self._patience
        while not self._photo.get_subscription_count() and time.monotonic() < deadline:
            time.sleep(0.1)
        time.sleep(SETTLE_S)
        for number, (stamp, path) in enumerate(self._states):
            time.sleep(self._period)
            if not self.context.ok():
                return
            self._publish_state(number, stamp, path.read_bytes())
        time.sleep(self._period)
        self.get_logger().info(f'all {len(self._states)} photographs were published')
        self.context.try_shutdown()

    def _publish_state(self, number: int, stamp: float, data: bytes) -> None:
        fault = self._faults.get(number)
        if fault is not None:
            self.get_logger().info(f'photograph {number} at {stamp:.0f} s is {fault}')
        if fault == 'missing':
            return
        if fault is not None and fault in FAULTS:
            data = FAULTS[fault](data)
        if fault == 'late':
            stamp = self._states[max(number - 1, 0)][0] - 0.5
        for _ in range(2 if fault == 'duplicate' else 1):
            self._publish(self._photo, stamp, data)

    def _publish(self, publisher: Any, stamp: float, data: bytes) -> None:
        self._clock_topic.publish(Clock(clock=conversions.time_to_msg(max(stamp, 0.0))))
        header = conversions.header_at(max(stamp, 0.0), conversions.CAMERA_FRAME)
        publisher.publish(
            CompressedImage(header=header, format='jpeg', data=array.array('B', data))
        )


def _photographs(
    folder: Path, interval: float
) -> tuple[list[tuple[float, Path]], list[tuple[float, Path]]]:
    """Return (time, path) of the baselines and of the states."""
    if (folder / 'imaging.csv').is_file():
        photos = read_photos(folder)
        roles = [
            [(photo.time, folder / photo.name) for photo in photos if photo.role == role]
            for role in ('baseline', 'state')
        ]
        return roles[0], roles[1]
    if not folder.is_dir():
        raise InputError(f"photos '{folder}': no such folder")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in PHOTO_SUFFIXES)
    if len(paths) < 2:
        raise InputError(f"photos '{folder}': needs a baseline and at least one state")
    return [(0.0, paths[0])], [(n * interval, path) for n, path in enumerate(paths[1:], 1)]


def main() -> None:
    """Run the node."""
    run(MockCameraNode)


if __name__ == '__main__':
    main()
