"""Turns photographs into states of the physical asset: maps of tracer concentration.

Callbacks only queue. One worker reads photograph after photograph. A photograph that cannot be used
costs one log line and a diagnostic, and the stream continues.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.photo_interval import LONGEST_GAP_S
from porotwin_core.clock.stamps import time_in_words
from porotwin_core.ros.conversions import (
    duration_to_msg,
    header_at,
    map_to_msg,
    time_from_msg,
    tracer_to_msg,
)
from porotwin_core.ros.following import Writers
from porotwin_core.ros.node import Diagnostics, TwinNode, declare, declare_grid, declare_rig, run
from porotwin_core.ros.qos import BASELINE, CONFIG, FIELD, PHOTO
from porotwin_core.ros.single_instance import only_one
from porotwin_imaging.live.experiment_start import ExperimentStart
from porotwin_imaging.live.imaging_session import WAITING_PHOTOS, ImagedState, ImagingSession
from porotwin_imaging.live.photo_queue import PhotoQueue, QueuedPhoto
from porotwin_imaging.photograph.file_hash import sha256_of_file
from porotwin_imaging.photograph.sent_photos import digest_of
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_msgs.msg import CleanState, NewState, StateRefreshed

LONGEST_WORK_S = 300.0
"""One photograph takes a second, and a minute with kernels to compile on a busy computer [s]."""


class ImagingNode(TwinNode):
    """The device of the paper: emits new states, refreshed states and clean states."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and start the worker.

        Raises:
            InputError: a parameter, the rig or the calibration is wrong.
        """
        super().__init__('imaging', **kwargs)
        rig = declare_rig(self)
        calibration = declare(self, 'calibration', '', 'path of a calibration file; empty: none')
        longest_gap = declare(
            self,
            'longest_gap',
            0.0,
            'longest time without photographs [s]; 0: automatic',
            at_least=0.0,
            at_most=LONGEST_GAP_S,
        )
        self._session = ImagingSession(
            rig,
            declare_grid(self, rig),
            calibration=load_calibration(calibration) if calibration else None,
            longest_gap_s=longest_gap or None,
            replayed=self.simulated,
        )
        kept = declare(
            self,
            'experiment_start',
            '',
            'file that keeps time and baselines of the experiment over a restart; empty: none',
        )
        self._start = ExperimentStart(Path(kept) if kept else None)
        self._calibration_hash = sha256_of_file(calibration)
        self._queue = PhotoQueue(WAITING_PHOTOS)
        self._diagnostics = Diagnostics(self, heard=('asset/new_state', 'asset/state_refreshed'))
        self._new_state = self.create_publisher(NewState, 'asset/new_state', FIELD)
        self._refreshed = self.create_publisher(StateRefreshed, 'asset/state_refreshed', FIELD)
        self._clean = self.create_publisher(CleanState, 'asset/clean_state', FIELD)
        self._experiment = self.create_publisher(Header, 'asset/experiment', CONFIG)
        if self._start.time is not None:
            self._experiment.publish(header_at(self._start.time))
        self._listen('baseline', 'camera/baseline/compressed', BASELINE)
        self._listen('state', 'camera/image/compressed', PHOTO)
        threading.Thread(target=self._work, daemon=True).start()

    def _listen(self, role: str, topic: str, profile: Any) -> None:
        def store(message: CompressedImage, info: Mapping[str, Any]) -> None:
            time = time_from_msg(message.header.stamp)
            try:
                if not writers.check(info):
                    return
            except InputError as error:
                self._complain(
                    f'{role} photograph of {time_in_words(time)} left out: {error}', time
                )
                return
            if left_out := self._queue.put(QueuedPhoto(role, time, bytes(message.data))):
                self._complain(str(left_out), time)

        writers = Writers(self, topic)
        writers.subscribe(CompressedImage, topic, store, profile)

    def _work(self) -> None:
        while self.context.ok():
            role, time, data = self._queue.get()
            waited = self._take(role, time, data)
            for photo in waited:  # before the photographs that came after them
                self._take('state', *photo)

    def _take(self, role: str, time: float, data: bytes) -> list[tuple[float, bytes]]:
        """Read one photograph; return those that have waited for it."""
        try:
            if role == 'baseline':
                return self._take_baseline(time, data)
            if self._session.baseline is not None:
                with self._diagnostics.busy(f'photograph of {time_in_words(time)}', LONGEST_WORK_S):
                    state = self._session.add_photo(time, data)
                self._publish(state)
            elif warning := self._session.waiting.add(time, data):
                self._complain(warning, time)
        except InputError as error:
            self._complain(f'{role} photograph of {time_in_words(time)} left out: {error}', time)
        except Exception as error:
            self._complain(f'{role} photograph of {time_in_words(time)} failed: {error!r}', time)
        return []

    def _take_baseline(self, time: float, data: bytes) -> list[tuple[float, bytes]]:
        if self._start.is_over(time, digest_of(data)):
            self._session.leave_out_baseline(data)
            self.get_logger().info(
                f'baseline photograph of {time_in_words(time)} belongs to an earlier experiment: '
                'left out'
            )
            return []
        waited = self._session.add_baseline(data)
        assert self._session.baseline is not None
        for remark in self._session.baseline.remarks:
            self.get_logger().info(f'baseline: {remark}')
        count = len(self._session.baseline_photos)
        self._diagnostics.report(
            DiagnosticStatus.OK, f'{count} baseline photographs', photograph_time=time
        )
        return waited

    def _publish(self, state: ImagedState) -> None:
        header = header_at(state.time)
        if state.placement.action == 'start':
            self._tell_start(state)
        self._new_state.publish(
            NewState(
                header=header,
                sequence=state.number,
                time_step=duration_to_msg(state.placement.time_step),
                tracer=tracer_to_msg(state.map.values, self._session.grid, state.time),
                noise=state.map.typical_noise,
                deviation=map_to_msg(state.map.deviation),
                systematic=map_to_msg(state.map.systematic),
                calibrated=state.map.calibrated,
                calibration=self._calibration_hash,
                remarks=state.map.status,
            )
        )
        self._refreshed.publish(StateRefreshed(header=header, sequence=state.number))
        self._report(state)

    def _tell_start(self, state: ImagedState) -> None:
        """Tell that a sequence of photographs begins, and perhaps an experiment with it."""
        header, reason = header_at(state.time), state.placement.reason
        cause = CleanState.INTERRUPTED
        if self._start.goes_on(state.time):
            reason = 'imaging was started again'
        elif state.placement.is_new_experiment:
            cause = CleanState.START
            try:
                self._start.note(state.time, [*map(digest_of, self._session.baseline_photos)])
            except OSError as error:
                self.get_logger().warning(f'a restart will count as a new experiment: {error}')
            self._experiment.publish(header)
        self._clean.publish(CleanState(header=header, cause=cause, reason=reason))

    def _report(self, state: ImagedState) -> None:
        found = state.map
        seconds = sum(found.timings.values())
        summary = f'photograph of {time_in_words(state.time)} read in {seconds:.2f} s'
        summary = '; '.join([summary, *found.status])
        self.get_logger().info(summary)
        self._diagnostics.report(
            DiagnosticStatus.WARN if found.suspicious else DiagnosticStatus.OK,
            summary,
            photograph_time=state.time,
            noise=found.typical_noise,
            **{f'{stage}_s': round(value, 4) for stage, value in found.timings.items()},
        )

    def _complain(self, text: str, time: float) -> None:
        line = ' '.join(text.split())
        self.get_logger().error(line)
        self._diagnostics.report(DiagnosticStatus.ERROR, line, photograph_time=time)


def main() -> None:
    """Run the node, unless another one is there."""
    run(only_one(ImagingNode, 'imaging'))


if __name__ == '__main__':
    main()
