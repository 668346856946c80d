"""Turns photographs into states of the physical asset: maps of tracer concentration.

Callbacks only queue; one worker reads photograph after photograph. A photograph that cannot be
used costs one log line and a diagnostic, and the stream goes on.
"""

import hashlib
import math
import queue
import threading
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from porotwin_core.conversions import header_at, time_from_msg, tracer_to_msg
from porotwin_core.errors import InputError
from porotwin_core.node import Diagnostics, declare, declare_grid, declare_rig, run
from porotwin_core.qos import BASELINE, FIELD, PHOTO
from porotwin_imaging.calibration import Calibration, load_calibration
from porotwin_imaging.chain import ConcentrationMap, Imaging
from porotwin_imaging.sequence import StateSequence, Verdict, Waiting
from porotwin_msgs.msg import CleanState, NewState, StateRefreshed

WAITING = 64
"""State photographs kept until a baseline arrives."""

TRACER, MOST_TRACER = 0.3, 0.02
"""Concentration of what counts as tracer in a new baseline, and the share of the rig it may have:
dye that stays behind in the grains is paler."""
BASELINES = 8


class ImagingNode(Node):
    """The device of the paper: emits new states, refreshed states and clean states."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and make the chain.

        Raises:
            InputError: a parameter, the rig or the calibration is wrong.
        """
        super().__init__('imaging', **kwargs)
        rig = declare_rig(self)
        calibration = declare(self, 'calibration', '', 'path of a calibration file; empty: none')
        longest_gap = declare(self, 'longest_gap', 0.0, 'time without photographs [s]; 0: by pace')
        self._grid = declare_grid(self, rig)
        self._imaging = Imaging(rig, self._grid, calibration=_calibration(calibration))
        self._sequence = StateSequence(longest_gap or None)
        self._count = 0
        self._baselines: list[bytes] = []
        self._waiting = Waiting(WAITING)
        self._queue: queue.Queue[tuple[str, float, bytes]] = queue.Queue()
        self._diagnostics = Diagnostics(self)
        self._new_state = self.create_publisher(NewState, 'asset/new_state', FIELD)
        self._refreshed = self.create_publisher(StateRefreshed, 'asset/state_refreshed', FIELD)
        self._clean = self.create_publisher(CleanState, 'asset/clean_state', FIELD)
        self._listen('baseline', 'camera/baseline/compressed', BASELINE)
        self._listen('state', 'camera/image/compressed', PHOTO)
        threading.Thread(target=self._work, daemon=True).start()

    def _listen(self, role: str, topic: str, profile: Any) -> None:
        def store(message: CompressedImage) -> None:
            self._queue.put((role, time_from_msg(message.header.stamp), bytes(message.data)))

        self.create_subscription(CompressedImage, topic, store, profile)

    def _work(self) -> None:
        while self.context.ok():
            role, time, data = self._queue.get()
            try:
                if role == 'baseline':
                    self._take_baseline(time, data)
                elif self._baselines:
                    self._read(time, data)
                elif line := self._waiting.add(time, data):
                    self._complain(line, time)
            except InputError as error:
                self._complain(f'{role} photograph at {time:.3f} s left out: {error}', time)
            except Exception as error:
                self._complain(f'{role} photograph at {time:.3f} s failed: {error!r}', time)

    def _take_baseline(self, time: float, data: bytes) -> None:
        new_experiment = self._count > 0
        if new_experiment:
            self._refuse_tracer(data)
        baselines = [data] if new_experiment else [*self._baselines, data][-BASELINES:]
        for remark in self._imaging.set_baselines(baselines):
            self.get_logger().info(f'baseline: {remark}')
        self._baselines = baselines
        if new_experiment:
            self._count = 0
            self._sequence.restart()
        self._diagnostics.report(
            DiagnosticStatus.OK, f'{len(baselines)} baseline photographs', photograph_time=time
        )
        for photo in self._waiting.release():
            self._queue.put(('state', *photo))

    def _refuse_tracer(self, data: bytes) -> None:
        """Raise InputError where a new baseline shows tracer against the one in use.

        A camera that was started again in the middle of a run takes what it sees first for one.
        """
        try:
            values = self._imaging.concentration(data).values
        except InputError:  # another view or sand: compared with the old one it says nothing
            return
        share = float(np.mean(values[np.isfinite(values)] > TRACER))
        if share > MOST_TRACER:
            raise InputError(
                f'as a new baseline it shows tracer on {100 * share:.0f} % of the rig; take one '
                'without tracer, or start the twin again. The baseline in use stays'
            )

    def _read(self, time: float, data: bytes) -> None:
        digest = hashlib.blake2b(data, digest_size=16).hexdigest()
        verdict = self._sequence.judge(time, digest)
        if verdict.action == 'ignore':
            self._complain(f'{verdict.reason}; left out', time)
            return
        found = self._imaging.concentration(data)
        self._sequence.accept(time, digest, verdict)
        if verdict.action == 'start':
            self._publish_clean(time, verdict)
        self._publish_state(time, verdict, found)

    def _publish_clean(self, time: float, verdict: Verdict) -> None:
        cause = CleanState.INTERRUPTED if self._count else CleanState.START
        self._clean.publish(CleanState(header=header_at(time), cause=cause, reason=verdict.reason))

    def _publish_state(self, time: float, verdict: Verdict, found: ConcentrationMap) -> None:
        noise = found.typical_noise
        self._new_state.publish(
            NewState(
                header=header_at(time),
                sequence=self._count,
                time_step=verdict.time_step,
                tracer=tracer_to_msg(found.values, self._grid, time),
                noise=noise if math.isfinite(noise) else math.nan,
                calibrated=found.calibrated,
                remarks=found.status,
            )
        )
        self._refreshed.publish(StateRefreshed(header=header_at(time), sequence=self._count))
        self._count += 1
        seconds = sum(found.timings.values())
        summary = '; '.join([f'photograph at {time:.3f} s read in {seconds:.2f} s', *found.status])
        self.get_logger().info(summary)
        self._diagnostics.report(
            DiagnosticStatus.WARN if found.suspicious else DiagnosticStatus.OK,
            summary,
            photograph_time=time,
            noise=noise,
            **{f'{stage}_s': round(value, 4) for stage, value in found.timings.items()},
        )

    def _complain(self, text: str, time: float) -> None:
        line = ' '.join(text.split())
        self.get_logger().error(line)
        self._diagnostics.report(DiagnosticStatus.ERROR, line, photograph_time=time)


def _calibration(path: str) -> Calibration | None:
    return load_calibration(path) if path else None


def main() -> None:
    """Run the node."""
    run(ImagingNode)


if __name__ == '__main__':
    main()
