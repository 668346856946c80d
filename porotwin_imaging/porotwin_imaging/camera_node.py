"""Publishes the photographs of a camera source, stamped with their exposure."""

import time
from pathlib import Path
from typing import Any, get_args

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import CompressedImage

from porotwin_core.basis.remark import Remark
from porotwin_core.clock.photo_interval import SILENT_INTERVALS
from porotwin_core.clock.stamps import time_in_words
from porotwin_core.ros.conversions import CAMERA_FRAME, header_at
from porotwin_core.ros.node import Diagnostics, TwinNode, declare, declare_photo_interval, run
from porotwin_core.ros.qos import BASELINE, PHOTO
from porotwin_core.ros.single_instance import only_one
from porotwin_imaging.camera.photo_forwarding import PhotoForwarder
from porotwin_imaging.camera.poll_schedule import PollSchedule
from porotwin_imaging.camera.subscriber_wait import SubscriberWait
from porotwin_imaging.photograph.file_names import one_line, printable
from porotwin_imaging.photograph.photo_clock import Trust
from porotwin_imaging.photograph.sent_photos import (
    SentPhotos,
    folder_of_launch,
    forget_ended_launches,
)
from porotwin_imaging.sources.camera_source import CameraPhoto, SourceKind
from porotwin_imaging.sources.source_registry import check_source, source_at

FORMATS = {b'\xff\xd8': 'jpeg', b'\x89P': 'png'}
"""Format of a file by its first two bytes; all others are TIFF."""
TICK_S = 0.1
"""Time between two looks at the schedule [s]."""
LONGEST_POLL_S = 60.0
"""A poll that takes longer [s] hangs, as on a network share that does not answer."""


class CameraNode(TwinNode):
    """Topics: `camera/image/compressed` (states), `camera/baseline/compressed` (latched)."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and open the source.

        Raises:
            InputError: a parameter is wrong, or at the first start no camera is there.
        """
        super().__init__('camera', **kwargs)
        source = declare(
            self, 'source', '', 'camera source, NAME:ADDRESS, such as folder:/mnt/camera'
        )
        kind, address = source_at(source)
        interval = declare_photo_interval(self)
        listeners = declare(
            self,
            'listeners',
            1,
            'number of subscribers to wait for, at most half a minute',
            at_least=0,
            at_most=32,
        )
        options = self._declare_options(kind)
        trust: Trust = declare(
            self,
            'trust',
            'exif',
            'first time of a photograph that may be believed; see docs/camera.md',
            choices=get_args(Trust),
        )
        sent = self._declare_progress(source)
        if not sent.began_before:
            check_source(source)
        self._forwarder = PhotoForwarder(
            kind.open(address, **options),
            send=self._publish,
            report=self._complain,
            say=self._say,
            sent=sent,
            interval_s=interval,
            trust=trust,
        )
        self._baseline = self.create_publisher(
            CompressedImage, 'camera/baseline/compressed', BASELINE
        )
        self._state = self.create_publisher(CompressedImage, 'camera/image/compressed', PHOTO)
        self._subscribers = SubscriberWait(listeners)
        self._diagnostics = Diagnostics(self)
        self._schedule = PollSchedule(kind.poll_interval_s or interval)
        self._source = source
        self._has_looked = False
        self._last_sent = time.monotonic()
        self._next_warning_s = SILENT_INTERVALS * interval
        self._forwarder.send_baselines_again()
        # polls follow real time, even if photographs are stamped by /clock, and may take as long as
        # an exposure
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        group = MutuallyExclusiveCallbackGroup()
        self.create_timer(TICK_S, self._poll, clock=steady, callback_group=group)

    def _declare_options(self, kind: SourceKind) -> dict[str, Any]:
        return {
            option.name: declare(
                self,
                option.name,
                option.default,
                option.description,
                at_least=option.at_least,
                at_most=option.at_most,
                choices=option.choices,
            )
            for option in kind.options
        }

    def _declare_progress(self, source: str) -> SentPhotos:
        progress = declare(
            self,
            'progress',
            '',
            'folder that remembers the photographs sent, for a restart; empty: a temporary one '
            'for each launch',
        )
        if progress:
            return SentPhotos(Path(progress))
        folder = folder_of_launch(source)
        forget_ended_launches(folder)
        return SentPhotos(folder)

    def _poll(self) -> None:
        connected = self._state.get_subscription_count()
        known = self.count_subscribers(self._state.topic_name)
        if not (self._subscribers.is_over(connected, known) and self._schedule.is_due()):
            return
        with self._diagnostics.busy('looking for photographs', LONGEST_POLL_S):
            self._forwarder.forward()
        self._schedule.polled(
            failed=bool(self._forwarder.absent), arriving=self._forwarder.arriving
        )
        if self._forwarder.absent:
            self._diagnostics.report(DiagnosticStatus.ERROR, self._forwarder.absent)
            return
        if not self._has_looked:
            # photographs that were there before may be old, those from now on are new
            self._say(one_line(f'looking for new photographs at {self._source}'))
            self._has_looked = True
        self._warn_of_silence()

    def _warn_of_silence(self) -> None:
        """Report once per interval that no photograph came for two of them."""
        silent_s = time.monotonic() - self._last_sent
        if silent_s < self._next_warning_s:
            return
        line = f'no photograph for {silent_s:.0f} s; is the camera on?'
        self._diagnostics.report(DiagnosticStatus.WARN, line)
        self._next_warning_s = silent_s + self._forwarder.interval_s

    def _say(self, line: str) -> None:
        self.get_logger().info(line)
        self._diagnostics.report(DiagnosticStatus.OK, line)

    def _complain(self, problem: Remark) -> None:
        self.get_logger().warning(str(problem))
        self._diagnostics.report(DiagnosticStatus.ERROR, str(problem), file=problem.key)

    def _publish(self, photo: CameraPhoto) -> None:
        message = CompressedImage(header=header_at(photo.time, CAMERA_FRAME))
        message.format = FORMATS.get(photo.data[:2], 'tiff')
        message.data.frombytes(photo.data)
        publisher = self._baseline if photo.role == 'baseline' else self._state
        publisher.publish(message)
        self._last_sent = time.monotonic()
        self._next_warning_s = SILENT_INTERVALS * self._forwarder.interval_s
        name = printable(photo.name)
        line = one_line(f'{photo.role} photograph {name}, taken {time_in_words(photo.time)}')
        self.get_logger().info(line)
        self._diagnostics.report(DiagnosticStatus.OK, line, file=name)

    def destroy_node(self) -> None:
        """Note the last photographs and end."""
        self._forwarder.keep()
        super().destroy_node()


def main() -> None:
    """Run the node, unless another one is there."""
    run(only_one(CameraNode, 'camera'))


if __name__ == '__main__':
    main()
