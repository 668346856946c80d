"""The diagnosis as an action, beside the live twin: of a recording, or of the run so far."""

import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from porotwin_core import conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.node import declare, declare_grid, declare_rig, run
from porotwin_core.wells import WellRates as Rates
from porotwin_diagnosis.data.live_run import LiveRun
from porotwin_diagnosis.examine import Diagnosis, diagnose
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import CleanState, NewState, Setpoint, WellRates

NICENESS = 10
"""Given way to the loop: the diagnosis takes what the twin leaves of the machine."""


class CalledOffError(Exception):
    """The goal was called off while the diagnosis ran."""


class DiagnosisNode(Node):
    """Keeps what the running graph has seen since its experiment began, and diagnoses on demand."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters, listen, offer the action.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('diagnosis', **kwargs)
        self._rig = declare_rig(self)
        self._grid = declare_grid(self, self._rig)
        self._preset = declare(self, 'preset', 'accurate', 'scheme whose gap is asked for')
        self._workers = declare(self, 'workers', 1, 'simulations at a time')
        self._output = declare(self, 'output', '', 'folder of diagnoses; empty: a temporary one')
        self._lock = threading.Lock()
        self._busy = threading.Lock()
        self._run = LiveRun(self._rig, self._grid)
        self.create_subscription(NewState, 'asset/new_state', self._on_state, qos.FIELD)
        self.create_subscription(Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT)
        self.create_subscription(WellRates, 'wells/measured', self._on_measured, qos.FIELD)
        self.create_subscription(CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        self._server = ActionServer(
            self,
            Diagnose,
            'diagnosis/diagnose',
            execute_callback=self._execute,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _on_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            stamp = conversions.time_from_msg(message.header.stamp)
            with self._lock:
                self._run.add_map(stamp, concentration, grid)
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')

    def _on_setpoint(self, message: Setpoint) -> None:
        stamp = conversions.time_from_msg(message.header.stamp)
        self._keep_rates(
            f'setpoint {message.sequence}', message, partial(self._run.add_commanded_rates, stamp)
        )

    def _on_measured(self, message: WellRates) -> None:
        start = conversions.time_from_msg(message.start)
        end = conversions.time_from_msg(message.header.stamp)
        self._keep_rates(
            'measured rates', message, partial(self._run.add_measured_rates, start, end)
        )

    def _keep_rates(
        self, what: str, message: Setpoint | WellRates, keep: Callable[[Rates], None]
    ) -> None:
        try:
            rates = conversions.rates_from_msg(message.wells)
        except InputError as error:
            self.get_logger().error(f'{what} ignored: {error}')
            return
        with self._lock:
            keep(rates)

    def _on_clean(self, message: CleanState) -> None:
        with self._lock:
            if message.cause == CleanState.START:
                self._run.note_evaluation_start()
            elif message.cause == CleanState.FINISHED:
                self._run.note_experiment_end()

    def _execute(self, goal: ServerGoalHandle) -> Any:
        """Answer a goal; one that comes while another is worked on is told so at once."""
        result = Diagnose.Result()
        if not self._busy.acquire(blocking=False):
            goal.abort()
            busy = InputError('diagnosis: one is running; wait for its result or call it off')
            result.outcome = conversions.refusal(busy)
            return result
        try:
            output = self._folder(goal.request.output)
            found = self._diagnose(goal, output)
        except CalledOffError:
            goal.canceled()
            result.outcome = conversions.refusal(InputError('diagnosis called off'))
            self.get_logger().info('diagnosis called off')
            return result
        except Exception as error:
            # whatever happens to one diagnosis, the node goes on listening
            self.get_logger().error(f'diagnosis failed: {error}')
            goal.abort()
            result.outcome = conversions.refusal(error)
            return result
        finally:
            self._busy.release()
        result.outcome = conversions.ok()
        result.verdict = found.verdict.name
        result.confidence = found.verdict.confidence
        result.error_before = found.summary['error']['before']
        result.error_after = found.summary['error']['after']
        result.report = str(output / 'report.html')
        self.get_logger().info(
            f'{found.verdict.name}, confidence {found.verdict.confidence:.2f}: {result.report}'
        )
        goal.succeed()
        return result

    def _diagnose(self, goal: ServerGoalHandle, output: Path) -> Diagnosis:
        """Diagnose the recording asked for, or the run so far, which is kept beside its report.

        Raises:
            InputError: it cannot be judged, or there is something where the run would be kept.
        """
        if goal.request.recording:
            return self._judge(goal, Path(goal.request.recording), output)
        recording = output / 'run'
        if recording.exists():
            raise InputError(f'{recording}: exists already; name another folder for the report')
        try:
            with self._lock:
                self._run.write(recording)
            return self._judge(goal, recording, output)
        except BaseException as error:
            shutil.rmtree(recording, ignore_errors=True)
            if isinstance(error, InputError):
                text = str(error).replace(str(recording), 'the run so far')
                raise InputError(text) from None
            raise

    def _judge(self, goal: ServerGoalHandle, recording: Path, output: Path) -> Diagnosis:
        return diagnose(
            recording,
            output,
            preset=self._preset,
            workers=self._workers,
            progress=_Feedback(goal),
        )

    def _folder(self, asked: str) -> Path:
        """Return where a diagnosis goes: as asked, or a new folder of its own."""
        if asked:
            return Path(asked)
        if not self._output:
            return Path(tempfile.mkdtemp(prefix='diagnosis_'))
        number = 1
        while (folder := Path(self._output) / f'diagnosis_{number:02d}').exists():
            number += 1
        return folder


class _Feedback:
    """Reports stage, share and an estimate of the time left; stops a goal that was called off."""

    def __init__(self, goal: ServerGoalHandle) -> None:
        self._goal = goal
        self._begin = time.monotonic()

    def __call__(self, stage: str, share: float) -> None:
        if self._goal.is_cancel_requested and share < 1.0:  # what is done is not called off
            raise CalledOffError
        elapsed = time.monotonic() - self._begin
        remaining = elapsed * (1.0 - share) / share if share > 0.02 else float('nan')
        self._goal.publish_feedback(
            Diagnose.Feedback(stage=stage, fraction=float(share), remaining=float(remaining))
        )


def main() -> None:
    """Run the node, at a low priority."""
    os.nice(NICENESS)  # before any thread is started: each inherits it
    run(DiagnosisNode, threads=3)  # one diagnoses, one listens, one refuses a second goal


if __name__ == '__main__':
    main()
