"""The diagnosis as an action, beside the live twin: of a recording, or of the run so far."""

import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from porotwin_core import conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.node import declare, run
from porotwin_core.rig import load_rig
from porotwin_core.wells import Schedule, WellRate
from porotwin_diagnosis.diagnose import diagnose
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import CleanState, NewState, WellRates
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.experiment import write_experiment


class CalledOffError(Exception):
    """The goal was called off while the diagnosis ran."""


class DiagnosisNode(Node):
    """Keeps what the running graph has seen since its last clean state, and diagnoses on demand."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters, listen, offer the action.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('diagnosis', **kwargs)
        self._rig = load_rig(declare(self, 'rig', '', 'path of rig.yaml'))
        text = declare(self, 'grid', str(self._rig.default_grid()), 'columns x rows of the maps')
        self._grid = Grid.parse(text, self._rig.width_m, self._rig.height_m)
        self._workers = declare(self, 'workers', 1, 'simulations at a time')
        self._lock = threading.Lock()
        self._busy = threading.Lock()
        self._frames: list[tuple[float, FloatArray]] = []
        self._told: list[tuple[float, dict[str, WellRate]]] = []
        self.create_subscription(NewState, 'asset/new_state', self._on_state, qos.FIELD)
        self.create_subscription(WellRates, 'wells/measured', self._on_measured, qos.FIELD)
        self.create_subscription(CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        self._server = ActionServer(
            self,
            Diagnose,
            'diagnosis/diagnose',
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _on_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            stamp = conversions.time_from_msg(message.header.stamp)
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')
            return
        if grid != self._grid:
            self.get_logger().error(f'state {message.sequence} ignored: on {grid}')
            return
        with self._lock:
            self._frames.append((stamp, concentration.astype(np.float32)))

    def _on_measured(self, message: WellRates) -> None:
        try:
            rates = conversions.rates_from_msg(message.wells)
            start = conversions.time_from_msg(message.start)
        except InputError as error:
            self.get_logger().error(f'measured rates ignored: {error}')
            return
        with self._lock:
            self._told.append((start, rates))

    def _on_clean(self, _message: CleanState) -> None:
        with self._lock:
            self._frames.clear()
            self._told.clear()

    def _on_goal(self, _goal: Any) -> GoalResponse:
        return GoalResponse.REJECT if self._busy.locked() else GoalResponse.ACCEPT

    def _execute(self, goal: ServerGoalHandle) -> Any:
        result = Diagnose.Result()
        output = goal.request.output or tempfile.mkdtemp(prefix='diagnosis_')
        with self._busy:
            try:
                with tempfile.TemporaryDirectory(prefix='porotwin_diagnosis_') as folder:
                    recording = goal.request.recording or self._so_far(Path(folder) / 'run')
                    found = diagnose(
                        recording,
                        output,
                        workers=self._workers,
                        progress=_Feedback(goal),
                    )
            except CalledOffError:
                goal.canceled()
                result.outcome = conversions.refusal(InputError('diagnosis called off'))
                return result
            except Exception as error:
                self.get_logger().error(f'diagnosis failed: {error}')
                goal.abort()
                result.outcome = conversions.refusal(error)
                return result
        result.outcome = conversions.ok()
        result.verdict = found.verdict.name
        result.confidence = found.verdict.confidence
        result.error_before = found.summary['error']['before']
        result.error_after = found.summary['error']['after']
        result.report = str(Path(output) / 'report.html')
        goal.succeed()
        self.get_logger().info(f'{found.verdict.name}, confidence {found.verdict.confidence:.2f}')
        return result

    def _so_far(self, folder: Path) -> Path:
        """Write what the graph has seen so far as an experiment folder."""
        with self._lock:
            frames, told = list(self._frames), list(self._told)
        if not frames:
            raise InputError('diagnosis: the running graph has shown nothing yet; wait a while')
        stack = np.stack([frame for _, frame in frames])
        times = np.array([stamp for stamp, _ in frames])
        maps = ConcentrationMaps(times, self._grid, lambda start, stop: stack[start:stop])
        write_experiment(folder, rig=self._rig, told=Schedule.from_rates(told), maps=maps)
        return folder


class _Feedback:
    """Reports stage, share and an estimate of the time left; stops a goal that was called off."""

    def __init__(self, goal: ServerGoalHandle) -> None:
        self._goal = goal
        self._begin = time.monotonic()

    def __call__(self, stage: str, share: float) -> None:
        if self._goal.is_cancel_requested:
            raise CalledOffError
        elapsed = time.monotonic() - self._begin
        remaining = elapsed * (1.0 - share) / share if share > 0.02 else float('nan')
        self._goal.publish_feedback(
            Diagnose.Feedback(stage=stage, fraction=float(share), remaining=float(remaining))
        )


def main() -> None:
    """Run the node."""
    run(DiagnosisNode)


if __name__ == '__main__':
    main()
