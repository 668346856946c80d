"""The diagnosis as an action beside the live twin: of a recording, or of the run so far."""

import math
import os
import shutil
import tempfile
import threading
from pathlib import Path
from typing import Any

from rclpy.action import ActionServer, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import MOST_WORKERS, YIELDING, crew
from porotwin_core.clock.freshness import stamp_doubts
from porotwin_core.ros import conversions
from porotwin_core.ros.from_messages import path_from_msg
from porotwin_core.ros.model_effects import ToldEffects
from porotwin_core.ros.node import (
    TwinNode,
    declare,
    declare_grid,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.run_topics import follow_run
from porotwin_core.ros.senders import cancels_of, goals_of
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_diagnosis.archive import ArchiveTask
from porotwin_diagnosis.data.live_run import RUN_FOLDER, LiveRun, forget_old_runs
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.progress import WorkClock
from porotwin_diagnosis.report.named_rows import verdict_words
from porotwin_diagnosis.report.report_folder import REPORT, checked_folder, write_diagnosis
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import CleanState, NewState
from porotwin_recording.experiment.bag import origin_of_state
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.presets import PRESETS

DIAGNOSE = 'diagnosis/diagnose'
"""Action of this node."""


class CanceledError(Exception):
    """The goal was canceled while the diagnosis ran."""


class DiagnosisNode(TwinNode):
    """Keeps the states and rates since the experiment began, and diagnoses on request."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters, subscribe, and offer the action.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('diagnosis', **kwargs)
        rig = declare_rig(self)
        grid = declare_grid(self, rig)
        self._preset = declare(
            self, 'preset', 'accurate', 'preset of the diagnosed model', choices=PRESETS
        )
        self._workers = declare(
            self, 'workers', 1, 'simulations at a time', at_least=1, at_most=MOST_WORKERS
        )
        self._output = declare(self, 'output', '', 'folder for diagnoses; empty: a temporary one')
        simulated = self.simulated
        self._doubt = stamp_doubts(declare_photo_interval(self), simulated=simulated)
        self._lock = threading.Lock()
        self._busy = threading.Lock()
        self._run = LiveRun(rig, grid, _existing_folder(self._output))
        follow_run(
            self,
            rates=self._run.rates,
            lock=self._lock,
            on_state=self._on_state,
            on_clean_state=self._on_clean,
            on_effects=self._on_effects,
        )
        self._callers = OnlyCaller(self, goals_of(DIAGNOSE))
        self._server = ActionServer(
            self,
            Diagnose,
            DIAGNOSE,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=OnlyCaller(self, cancels_of(DIAGNOSE)).cancels,
            # a forged goal is waited for, and a photograph must not wait for it
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    def _on_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            stamp = conversions.time_from_msg(message.header.stamp)
            if doubt := self._doubt(stamp):  # one wrong stamp would end the run
                raise InputError(doubt)
            deviation = conversions.deviation_from_msg(message.deviation, grid)
            systematic = conversions.deviation_from_msg(message.systematic, grid)
            with self._lock:
                self._run.add_map(
                    stamp,
                    concentration,
                    grid,
                    deviation=deviation,
                    systematic=systematic,
                    origin=origin_of_state(message, PROGRAM),
                )
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')

    def _on_clean(self, message: CleanState) -> None:
        with self._lock:
            if message.cause == CleanState.START:
                self._run.note_evaluation_start()
            elif message.cause == CleanState.FINISHED:
                self._run.note_experiment_end()

    def _on_effects(self, told: ToldEffects) -> None:
        with self._lock:
            self._run.note_effects(told.effects)

    def _on_goal(self, goal: Diagnose.Goal) -> GoalResponse:
        try:
            self._callers.check(goal)
        except InputError as error:
            self.get_logger().error(f'diagnosis refused: {error}')
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _execute(self, goal: ServerGoalHandle) -> Any:
        """Answer a goal. A goal that comes during a diagnosis is refused at once."""
        if not self._busy.acquire(blocking=False):
            goal.abort()
            return _refusal(
                InputError('diagnosis: one is running; wait for its result or cancel it')
            )
        try:
            result = self._diagnose(goal, self._folder(goal.request.output))
        except CanceledError:
            goal.canceled()
            self.get_logger().info('diagnosis canceled')
            return _refusal(InputError('diagnosis canceled'))
        except Exception as error:  # a failed diagnosis must not end the node
            self.get_logger().error(f'diagnosis failed: {error}')
            goal.abort()
            return _refusal(error)
        finally:
            self._busy.release()
        goal.succeed()
        return result

    def _diagnose(self, goal: ServerGoalHandle, output: Path) -> Diagnose.Result:
        """Diagnose the requested recording, or the run so far, which is kept beside its report.

        Raises:
            InputError: the recording cannot be judged, the folder of the run exists already, or
                `output` holds something else than a diagnosis of the same.
        """
        if goal.request.recording:
            recording = path_from_msg(goal.request.recording)
            self._check_folder(output, recording)
            return self._diagnose_recording(goal, recording, output)
        recording = output / RUN_FOLDER
        if recording.exists():
            raise InputError(f'{recording}: exists already; name another folder for the report')
        self._check_folder(output, recording)
        try:
            with self._lock:
                self._run.write(recording)
            return self._diagnose_recording(goal, recording, output)
        except BaseException as error:
            shutil.rmtree(recording, ignore_errors=True)
            if isinstance(error, InputError):
                text = str(error).replace(str(recording), 'the run so far')
                raise InputError(text) from None
            raise

    def _check_folder(self, output: Path, recording: Path) -> None:
        other = ArchiveTask(recording, output, preset=self._preset).difference
        if other and output.is_dir() and any(output.iterdir()):
            raise InputError(
                f'{output}: is not empty, and {other}; name a new folder for the report'
            )

    def _diagnose_recording(
        self, goal: ServerGoalHandle, recording: Path, output: Path
    ) -> Diagnose.Result:
        progress = _Feedback(goal)
        opened = open_recording(recording)
        folder = checked_folder(output, [recording])
        with crew(workers=self._workers, threads=True) as threads:
            found = examine(
                [opened],
                DiagnosisSettings(
                    preset=self._preset,
                    crew=threads,
                    progress=progress,
                    tell=self.get_logger().warning,
                ),
            )
        summary = write_diagnosis(found, folder, progress=progress)
        report, confidence = output / REPORT, found.verdict.confidence
        self.get_logger().info(f'{verdict_words(summary)}, confidence {confidence:.2f}: {report}')
        return Diagnose.Result(
            outcome=conversions.ok(),
            verdict=found.verdict.name,
            confidence=confidence,
            error_before=summary['error']['before'],
            error_after=summary['error']['after'],
            report=str(report),
        )

    def _folder(self, requested: str) -> Path:
        """Return the folder of a diagnosis: the requested one, or a new one."""
        if requested:
            return path_from_msg(requested)
        if not self._output:
            return Path(tempfile.mkdtemp(prefix='diagnosis_'))
        number = 1
        while (folder := Path(self._output) / f'diagnosis_{number:02d}').exists():
            number += 1
        forget_old_runs(Path(self._output))
        return folder


def _existing_folder(path: str) -> Path | None:
    """Return the folder `path`, made if needed; None for an empty path.

    Raises:
        InputError: it cannot be made.
    """
    if not path:
        return None
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name another folder for output') from None
    return Path(path)


def _refusal(error: Exception) -> Diagnose.Result:
    return Diagnose.Result(outcome=conversions.refusal(error))


class _Feedback:
    """Publishes stage, fraction and the remaining time at most; stops a canceled goal."""

    def __init__(self, goal: ServerGoalHandle) -> None:
        self._goal = goal
        self._clock = WorkClock()

    def __call__(self, stage: str, fraction: float) -> None:
        if self._goal.is_cancel_requested and fraction < 1.0:  # a finished diagnosis is delivered
            raise CanceledError
        self._clock.reach(fraction)
        left = self._clock.left
        self._goal.publish_feedback(
            Diagnose.Feedback(
                stage=stage,
                fraction=float(fraction),
                remaining=conversions.duration_to_msg(left if math.isfinite(left) else 0.0),
            )
        )


def main() -> None:
    """Run the node at a low priority."""
    os.nice(YIELDING)  # before any thread starts, because each inherits the value
    run(only_one(DiagnosisNode, 'diagnosis'))


if __name__ == '__main__':
    main()
