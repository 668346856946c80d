"""Publishes the photographs of a camera source, stamped with their exposure."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from porotwin_core.conversions import CAMERA_FRAME, header_at
from porotwin_core.node import Diagnostics, declare, run
from porotwin_core.qos import BASELINE, PHOTO
from porotwin_imaging.photo_forwarding import PhotoForwarder
from porotwin_imaging.sources.camera_source import CameraPhoto, PhotoProblem
from porotwin_imaging.sources.source_registry import source_at
from porotwin_imaging.subscriber_wait import SubscriberWait

FORMATS = {b'\xff\xd8': 'jpeg', b'\x89P': 'png'}
"""Format of a file by its first two bytes; all others are TIFF."""


class CameraNode(Node):
    """Topics: `camera/image/compressed` (states), `camera/baseline/compressed` (latched)."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and open the source.

        Raises:
            InputError: a parameter is wrong, or the source cannot be opened.
        """
        super().__init__('camera', **kwargs)
        kind, address = source_at(
            declare(self, 'source', '', 'camera source, NAME:ADDRESS, such as folder:/mnt/camera')
        )
        interval = declare(self, 'photo_interval_s', 30.0, 'time between photographs [s]')
        listeners = declare(
            self, 'listeners', 1, 'number of subscribers to wait for, at most half a minute'
        )
        options = {
            option.name: declare(self, option.name, option.default, option.description)
            for option in kind.options
        }
        self._forwarder = PhotoForwarder(
            kind.open(address, **options), send=self._publish, report=self._complain
        )
        self._baseline = self.create_publisher(
            CompressedImage, 'camera/baseline/compressed', BASELINE
        )
        self._state = self.create_publisher(CompressedImage, 'camera/image/compressed', PHOTO)
        self._subscribers = SubscriberWait(listeners)
        self._diagnostics = Diagnostics(self)
        # polls follow real time, even if photographs are stamped by /clock
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(kind.poll_interval_s or interval, self._poll, clock=steady)

    def _poll(self) -> None:
        connected = self._state.get_subscription_count()
        known = self.count_subscribers(self._state.topic_name)
        if self._subscribers.is_over(connected, known):
            self._forwarder.forward()

    def _complain(self, problem: PhotoProblem) -> None:
        self.get_logger().warning(problem.reason)
        self._diagnostics.report(DiagnosticStatus.ERROR, problem.reason, file=problem.name)

    def _publish(self, photo: CameraPhoto) -> None:
        message = CompressedImage(header=header_at(photo.time, CAMERA_FRAME))
        message.format = FORMATS.get(photo.data[:2], 'tiff')
        message.data.frombytes(photo.data)
        publisher = self._baseline if photo.role == 'baseline' else self._state
        publisher.publish(message)
        line = f'{photo.role} photograph {photo.name}, exposed at {photo.time:.3f} s'
        self.get_logger().info(line)
        self._diagnostics.report(DiagnosticStatus.OK, line, file=photo.name)


def main() -> None:
    """Run the node."""
    run(CameraNode)


if __name__ == '__main__':
    main()
