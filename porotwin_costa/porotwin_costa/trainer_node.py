"""The trainer: listens to the asset's states and has COSTA trained again every so many of them.

For each pair of consecutive states it asks the solver for the prediction and the exact residual;
everything is asynchronous, one pair at a time. After `retrain_every` new pairs it sends the goal
`costa/train`, whose success puts the new model to work.
"""

import atexit
import tempfile
import time
from collections import deque
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from porotwin_core import conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, fill_unseen
from porotwin_core.node import declare, declare_grid, declare_rig, run
from porotwin_costa.collector import Collector, Pair
from porotwin_costa.dataset import load_dataset
from porotwin_costa.physics_id import PhysicsId
from porotwin_msgs.action import Train
from porotwin_msgs.msg import CleanState, NewState, Outcome, WellRates
from porotwin_msgs.srv import Predict, Residual

_PART = 10
"""Pairs that are written together; a crash costs one fewer at most."""

REPORT_S = 60.0
"""Shortest time between two reports of what was left out [s]."""

SILENCE_S = 300.0
"""A training that has not reported an epoch for so long is lost [s]."""


class TrainerNode(Node):
    """Client of the asset, the solver and COSTA."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and listen.

        Raises:
            InputError: a parameter, the rig description or an existing data set is wrong.
        """
        super().__init__('trainer', **kwargs)
        rig = declare_rig(self)
        self._grid = declare_grid(self, rig)
        preset = declare(self, 'preset', '', 'scheme of the solver; empty: not known')
        self._time_step = declare(self, 'photo_interval_s', 30.0, 'time between photographs [s]')
        self._every = declare(self, 'retrain_every', 40, 'new pairs between two trainings')
        self._architecture = declare(self, 'architecture', '', 'network; empty: that of costa')
        self._output = declare(self, 'output', '', 'path for the weights; empty: in memory only')
        self._seed = declare(self, 'seed', 1, 'seed of the training')
        self._patience = declare(self, 'model_timeout_s', 20.0, 'longest wait for the solver [s]')
        self._dataset = self._folder(declare(self, 'dataset', '', 'folder; empty: a temporary one'))
        self._collector = Collector(
            rig,
            self._grid,
            self._time_step,
            first_experiment=self._known_experiments(PhysicsId.of(rig, preset)),
            preset=preset,
        )
        self._dropped = 0
        self._pending: deque[Pair] = deque(maxlen=1000)
        self._pair: Pair | None = None
        self._training_due = False
        self._training = False
        self._training_heard = 0.0
        self._asked: Future | None = None
        self._asked_at = 0.0
        self._predict = self.create_client(Predict, 'solver/predict')
        self._residual = self.create_client(Residual, 'solver/residual')
        self._train = ActionClient(self, Train, 'costa/train')
        self.create_subscription(NewState, 'asset/new_state', self._on_state, qos.FIELD)
        self.create_subscription(CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        self.create_subscription(WellRates, 'wells/measured', self._on_measured, qos.FIELD)
        # not the node's clock: a solver may fall silent while simulated time stands still
        self.create_timer(0.5, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f'collecting training pairs in {self._dataset}')

    def _folder(self, text: str) -> Path:
        if text:
            # told to stop, the trainer keeps what is complete
            atexit.register(self._write)
            return Path(text)
        self._temporary = tempfile.TemporaryDirectory(prefix='porotwin_costa_')
        return Path(self._temporary.name)

    def _known_experiments(self, physics: PhysicsId) -> int:
        if not any(self._dataset.glob('part_*.safetensors')):
            return 0
        known = load_dataset(self._dataset)
        if known.grid != self._grid or known.time_step != self._time_step:
            raise InputError(
                f'{self._dataset}: holds pairs on {known.grid} every {known.time_step:g} s, the '
                f'twin runs on {self._grid} every {self._time_step:g} s; name another folder'
            )
        if difference := known.physics.difference(physics):
            raise InputError(f'{self._dataset}: holds pairs of {difference}; name another folder')
        return int(known.experiment.max()) + 1

    def _on_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            stamp = conversions.time_from_msg(message.header.stamp)
            self._pending.extend(self._collector.observed(stamp, concentration, grid))
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')
        self._report_dropped()
        self._next()

    def _report_dropped(self) -> None:
        """Say what cannot be learned from: a trainer that collects nothing must not be silent."""
        dropped = self._collector.dropped
        if dropped.total() == self._dropped:
            return
        self._dropped = dropped.total()
        reasons = ', '.join(f'{count} {reason}' for reason, count in dropped.items())
        self.get_logger().warning(
            f'{self._collector.completed} training pairs so far; left out: {reasons}',
            throttle_duration_sec=REPORT_S,
        )

    def _on_clean(self, message: CleanState) -> None:
        if message.cause == CleanState.FINISHED:
            self._pending.extend(self._collector.finished())
        else:
            self._collector.interrupted(conversions.time_from_msg(message.header.stamp))
        self.get_logger().info(f'time sequence interrupted: {message.reason}')
        self._report_dropped()
        self._next()

    def _on_measured(self, message: WellRates) -> None:
        try:
            rates = conversions.rates_from_msg(message.wells)
            self._collector.measured(conversions.time_from_msg(message.start), rates)
        except InputError as error:
            self.get_logger().error(f'measured rates ignored: {error}')

    def _on_timer(self) -> None:
        self._next()
        self._give_up_lost_training()
        if self._training_due and not self._training and self._train.server_is_ready():
            self._retrain()

    def _give_up_lost_training(self) -> None:
        """Ask again for a training whose node is gone: its result will never come."""
        silence = time.monotonic() - self._training_heard
        if self._training and (silence > SILENCE_S or not self._train.server_is_ready()):
            self.get_logger().warning('costa went away while it trained; asking again')
            self._training_due, self._training = True, False

    def _next(self) -> None:
        """Ask for the next pair's prediction, unless the solver is absent or still thinking."""
        if self._asked is not None:
            if time.monotonic() - self._asked_at < self._patience:
                return
            self.get_logger().warning(f'the solver did not answer in {self._patience:g} s')
            self._asked = None
        ready = self._predict.service_is_ready() and self._residual.service_is_ready()
        if not ready or not (self._pair or self._pending):
            return
        self._pair = pair = self._pair or self._pending.popleft()
        request = Predict.Request(
            previous=self._tracer(self._collector.start(pair), pair.end - self._time_step),
            wells=conversions.rates_to_msg(pair.rates),
            time_step=self._time_step,
        )
        self._ask(self._predict, request, lambda answer: self._on_predicted(pair, answer))

    def _tracer(self, concentration: FloatArray, time: float) -> Any:
        return conversions.tracer_to_msg(concentration, self._grid, time)

    def _ask(self, client: Any, request: Any, use: Any) -> None:
        future = client.call_async(request)
        self._asked, self._asked_at = future, time.monotonic()

        def done(answered: Future) -> None:
            if answered is not self._asked:
                return
            self._asked = None
            answer = answered.result()
            if answer.outcome.code == Outcome.OK:
                use(answer)
            else:
                self._pair = None
                self.get_logger().error(f'pair left out, solver: {answer.outcome.message}')
            self._next()

        future.add_done_callback(done)

    def _on_predicted(self, pair: Pair, answer: Predict.Response) -> None:
        predicted, _ = conversions.tracer_from_msg(answer.predicted)
        request = Residual.Request(
            previous=self._tracer(self._collector.start(pair), pair.end - self._time_step),
            next=self._tracer(fill_unseen(pair.following, predicted), pair.end),
            wells=conversions.rates_to_msg(pair.rates),
            time_step=self._time_step,
        )
        self._ask(
            self._residual, request, lambda answer: self._on_residual(pair, predicted, answer)
        )

    def _on_residual(self, pair: Pair, predicted: FloatArray, answer: Residual.Response) -> None:
        residual, _ = conversions.source_from_msg(answer.residual)
        self._pair = None
        self._collector.complete(pair, predicted, residual)
        retrain = self._collector.completed % self._every == 0
        if retrain or self._collector.untaken >= _PART:
            self._write()
        self._training_due = self._training_due or retrain

    def _write(self) -> None:
        if not self._collector.untaken:
            return
        try:
            self._collector.take().append_to(self._dataset)
        except InputError as error:
            self.get_logger().error(f'training pairs lost: {error}')

    def _retrain(self) -> None:
        self._training_due, self._training = False, True
        self._on_feedback()
        goal = Train.Goal(
            dataset=str(self._dataset),
            output=self._output,
            architecture=self._architecture,
            seed=self._seed,
        )
        asked = self._train.send_goal_async(goal, self._on_feedback)
        asked.add_done_callback(self._on_goal_answer)

    def _on_feedback(self, _: Any = None) -> None:
        self._training_heard = time.monotonic()

    def _on_goal_answer(self, future: Future) -> None:
        handle = future.result()
        if not handle.accepted:
            # somebody else has COSTA trained just now: ask again
            self._training_due, self._training = True, False
            return
        handle.get_result_async().add_done_callback(self._on_trained)

    def _on_trained(self, future: Future) -> None:
        self._training = False
        result = future.result().result
        if result.outcome.code != Outcome.OK:
            self.get_logger().error(f'training failed: {result.outcome.message}')
            return
        self.get_logger().info(
            f'trained on {result.samples} pairs, {result.epochs} epochs, '
            f'validation loss {result.validation_loss:.3f}'
        )


def main() -> None:
    """Run the node in one thread: answers and messages never meet."""
    run(TrainerNode, threads=1)


if __name__ == '__main__':
    main()
