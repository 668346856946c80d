"""Publishes photographs from a watched folder or a camera, stamped with their exposure."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from porotwin_core.conversions import CAMERA_FRAME, header_at
from porotwin_core.errors import InputError
from porotwin_core.node import Diagnostics, declare, run
from porotwin_core.qos import BASELINE, PHOTO
from porotwin_imaging.audience import Audience
from porotwin_imaging.sources import Device, Folder, Photo, Problem, Source

FORMATS = {b'\xff\xd8': 'jpeg', b'\x89P': 'png'}


class CameraNode(Node):
    """Topics: `camera/image/compressed` (states), `camera/baseline/compressed` (latched)."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and open the folder or camera.

        Raises:
            InputError: a parameter is wrong, the folder or camera is not there.
        """
        super().__init__('camera', **kwargs)
        self._source = self._make_source()
        period = declare(self, 'period', 0.0, 'time between two looks [s]; 0: 0.5, device: 30')
        self._baseline = self.create_publisher(
            CompressedImage, 'camera/baseline/compressed', BASELINE
        )
        self._state = self.create_publisher(CompressedImage, 'camera/image/compressed', PHOTO)
        listeners = declare(self, 'listeners', 1, 'how many photographs wait for, half a minute')
        self._audience = Audience(listeners)
        self._diagnostics = Diagnostics(self)
        default = 0.5 if isinstance(self._source, Folder) else 30.0
        # looks go by real time, also where photographs are stamped by /clock
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(period or default, self._look, clock=steady)

    def _make_source(self) -> Source:
        photos = declare(self, 'photos', '', 'folder that the camera writes to')
        device = declare(self, 'device', '', 'camera, as a number or /dev/video0')
        width = declare(self, 'width', 0, 'columns asked of the camera [px]; 0: its own')
        height = declare(self, 'height', 0, 'rows asked of the camera [px]; 0: its own')
        patience = declare(self, 'patience', 10.0, 'wait for a file still being written [s]')
        if bool(photos) == bool(device):
            raise InputError("camera: give one of the parameters 'photos' and 'device'")
        if photos:
            return Folder(photos, patience=patience)
        return Device(device, width=width, height=height)

    def _look(self) -> None:
        listening = self._state.get_subscription_count()
        if not self._audience.is_complete(
            listening, self.count_subscribers(self._state.topic_name)
        ):
            return
        # started again, the node would find the same file and die again: whatever fails, it goes on
        try:
            photos, problems = self._source.poll()
        except Exception as error:
            self._complain(Problem('', f'looking for photographs failed: {error!r}'))
            return
        for problem in problems:
            self._complain(problem)
        for photo in photos:
            try:
                self._publish(photo)
            except Exception as error:
                reason = f"photograph '{photo.name}' cannot be sent: {error!r}"
                self._complain(Problem(photo.name, reason))

    def _complain(self, problem: Problem) -> None:
        self.get_logger().warning(problem.reason)
        self._diagnostics.report(DiagnosticStatus.ERROR, problem.reason, file=problem.name)

    def _publish(self, photo: Photo) -> None:
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
