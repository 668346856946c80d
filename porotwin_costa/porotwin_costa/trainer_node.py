"""The trainer: collects training pairs from the asset's states and has COSTA trained again.

For each pair of consecutive states it asks the solver for the prediction and the exact residual,
one pair at a time and without blocking. After `retrain_every` new pairs it sends the goal
`costa/train`; on success COSTA uses the new weights.
"""

import atexit
import time
from collections import deque
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.task import Future

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import POLL_S
from porotwin_core.geometry.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rig import EffectDescription
from porotwin_core.ros import conversions, senders
from porotwin_core.ros.model_effects import ToldEffects
from porotwin_core.ros.node import (
    REPORT_S,
    TwinNode,
    declare,
    declare_grid,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.run_topics import follow_run
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import Voucher
from porotwin_costa.data.collector import Collector, Pair
from porotwin_costa.data.dataset import Dataset, dataset_parts, load_dataset
from porotwin_costa.data.physics_id import PhysicsId
from porotwin_costa.networks.network_registry import ARCHITECTURES
from porotwin_costa.training.retraining import Retraining
from porotwin_msgs.action import Train
from porotwin_msgs.msg import CleanState, NewState, Outcome
from porotwin_msgs.srv import Predict, Residual

PAIRS_PER_FILE = 10
"""Pairs that are written together; a crash costs fewer than that."""

PENDING_PAIRS = 1000
"""Pairs kept while the solver is absent: eight hours of photographs every 30 s."""

MOST_TRIES = 3
"""Attempts at a pair that the solver fails at. Another client may have cancelled all requests."""

RETRY_S = 2.0
"""Time until a pair is tried again [s]."""

TRAIN = 'costa/train'
"""Action of the node costa."""


class TrainerNode(TwinNode):
    """Client of the asset, the solver and COSTA."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and the data set that is there already, and subscribe.

        Raises:
            InputError: a parameter, the rig description or an existing data set is wrong.
        """
        super().__init__('trainer', **kwargs)
        self._rig = declare_rig(self)
        self._grid = declare_grid(self, self._rig)
        self._preset = declare(self, 'preset', '', 'numerical scheme of the solver; empty: unknown')
        self._time_step = declare_photo_interval(self)
        self._every = declare(
            self,
            'retrain_every',
            40,
            'new pairs between two trainings',
            at_least=1,
            at_most=1_000_000,
        )
        self._architecture = declare(
            self,
            'architecture',
            '',
            'network to train; empty: the choice of the node costa',
            choices=('', *ARCHITECTURES),
        )
        self._output = declare(self, 'output', '', 'file for the weights; empty: none')
        self._seed = declare(self, 'seed', 1, 'seed of the training', at_least=0)
        self._model_timeout = declare(
            self,
            'model_timeout_s',
            20.0,
            'longest wait for an answer of the solver [s]',
            at_least=0.01,
            at_most=3600.0,
            on_change=self._change_model_timeout,
        )
        self._pairs_folder = _dataset_folder(
            declare(self, 'dataset', '', 'folder for the training pairs; must be given')
        )
        self._pending: deque[Pair] = deque(maxlen=PENDING_PAIRS)
        self._request_time = 0.0
        self._rates = RateHistory.of(self._rig)
        self._effects: tuple[EffectDescription, ...] = ()
        self._begin_collecting()
        self._connect()
        atexit.register(self._write)

    def _begin_collecting(self) -> None:
        """Collect pairs of the physics in force; those of other physics have folders of their own.

        Raises:
            InputError: an existing data set is wrong.
        """
        rig = self._rig.with_effects(self._effects)
        folder, physics = self._pairs_folder, PhysicsId.of(rig, self._preset)
        if self._effects:
            folder = folder.with_name(f'{folder.name}_{physics.rig}')
        known = known_pairs(folder, self._grid, self._time_step, physics)
        self._dataset = folder
        self._collector = Collector(
            rig,
            self._grid,
            self._time_step,
            self._rates,
            first_experiment=int(known.experiment.max()) + 1 if known else 0,
            preset=self._preset,
        )
        self._dropped = 0
        self._retraining = Retraining(self._every, len(known) if known else 0)
        self._pending.clear()
        self._pair: Pair | None = None
        self._failures = 0
        self._next_request = 0.0
        self._request: tuple[Any, Future] | None = None
        count = len(known) if known else 0
        self.get_logger().info(f'training pairs in {self._dataset}: {count} so far')

    def _on_effects(self, told: ToldEffects) -> None:
        """Collect anew when the solver has other effects: its residuals are others then."""
        if told.effects != self._effects:
            self._write()
            self._effects = told.effects
            self._begin_collecting()

    def _change_model_timeout(self, seconds: float) -> None:
        self._model_timeout = seconds

    def _connect(self) -> None:
        self._predict = self.create_client(Predict, 'solver/predict')
        self._residual = self.create_client(Residual, 'solver/residual')
        self._train = ActionClient(self, Train, TRAIN)
        self._voucher = Voucher(self)
        follow_run(
            self,
            rates=self._rates,
            lock=nullcontext(),  # one thread
            on_state=self._on_state,
            on_clean_state=self._on_clean,
            on_effects=self._on_effects,
        )
        # not the node's clock: simulated time may stand still while the solver is silent
        self.create_timer(POLL_S, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

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
        """Warn of pairs left out: a trainer that collects nothing must not be silent."""
        if self._collector.dropped.total() != self._dropped:
            self._dropped = self._collector.dropped.total()
            self.get_logger().warning(self._collector.report, throttle_duration_sec=REPORT_S)

    def _on_clean(self, message: CleanState) -> None:
        if message.cause == CleanState.FINISHED:
            self._pending.extend(self._collector.finished())
        else:
            self._collector.interrupted(conversions.time_from_msg(message.header.stamp))
        self.get_logger().info(f'time sequence interrupted: {message.reason}')
        self._report_dropped()
        self._next()

    def _on_timer(self) -> None:
        self._next()
        ready = self._train.server_is_ready() and not self._foreign(senders.goals_of(TRAIN))
        if self._retraining.lost(time.monotonic(), server_ready=ready):
            self.get_logger().warning('the training was lost; it is sent again')
        if ready and self._retraining.wanted(time.monotonic()):
            self._retrain()

    def _next(self) -> None:
        """Ask for the prediction of the next pair, unless the solver is absent or still busy."""
        now = time.monotonic()
        if self._request is not None:
            if now - self._request_time < self._model_timeout:
                return
            client, future = self._request
            self._request = None
            client.remove_pending_request(future)
            self._failed(f'it did not answer in {self._model_timeout:g} s')
        ready = self._predict.service_is_ready() and self._residual.service_is_ready()
        if not ready or now < self._next_request or not (self._pair or self._pending):
            return
        if self._foreign(self._predict.srv_name) or self._foreign(self._residual.srv_name):
            self._next_request = now + RETRY_S
            return
        self._pair = pair = self._pair or self._pending.popleft()
        request = Predict.Request(
            previous=self._start_message(pair),
            wells=conversions.rates_to_msg(pair.rates),
            time_step=conversions.duration_to_msg(self._time_step),
        )
        self._send(self._predict, request, lambda answer: self._on_predicted(pair, answer))

    def _failed(self, reason: str) -> None:
        """Try the pair in work again later, or leave it out after some failures."""
        self._failures += 1
        self._next_request = time.monotonic() + RETRY_S
        if self._failures < MOST_TRIES:
            self.get_logger().warning(f'solver: {reason}; the pair is tried again')
        else:
            self._leave_out(reason)

    def _leave_out(self, reason: str) -> None:
        self._pair, self._failures = None, 0
        self.get_logger().error(f'pair left out, solver: {reason}')

    def _start_message(self, pair: Pair) -> Any:
        start = pair.end - self._time_step
        return conversions.tracer_to_msg(self._collector.start_state(pair), self._grid, start)

    def _send(self, client: Any, request: Any, use: Any) -> None:
        """Send a request to the solver; call `use` with the answer if it is in time and good."""
        future = client.call_async(request)
        self._request, self._request_time = (client, future), time.monotonic()

        def done(answered: Future) -> None:
            if self._request is None or answered is not self._request[1]:
                return
            self._request = None
            if self._foreign(client.srv_name):
                self._next_request = time.monotonic() + RETRY_S
            else:
                self._take(answered.result(), use)
            self._next()

        future.add_done_callback(done)

    def _foreign(self, service: str) -> bool:
        """Return whether another node offers a service too; the pair or the training then waits."""
        try:
            senders.check_servers(self, service)
        except InputError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=REPORT_S)
            return True
        return False

    def _take(self, answer: Any, use: Any) -> None:
        """Call `use` with a good `answer` of the solver; after a bad one the pair waits or goes."""
        outcome = answer.outcome
        try:
            if outcome.code == Outcome.OK:
                use(answer)
            elif outcome.code == Outcome.INVALID_INPUT:
                self._leave_out(outcome.message)
            elif outcome.code == Outcome.NOT_READY:
                self._next_request = time.monotonic() + RETRY_S
            else:
                self._failed(outcome.message)
        except InputError as error:
            self._leave_out(str(error))

    def _on_predicted(self, pair: Pair, answer: Predict.Response) -> None:
        predicted, _ = conversions.tracer_from_msg(answer.predicted)
        following = fill_unseen(pair.following, predicted)
        request = Residual.Request(
            previous=self._start_message(pair),
            next=conversions.tracer_to_msg(following, self._grid, pair.end),
            wells=conversions.rates_to_msg(pair.rates),
            time_step=conversions.duration_to_msg(self._time_step),
        )
        self._send(
            self._residual, request, lambda answer: self._on_residual(pair, predicted, answer)
        )

    def _on_residual(self, pair: Pair, predicted: FloatArray, answer: Residual.Response) -> None:
        residual, _ = conversions.source_from_msg(answer.residual)
        self._pair, self._failures = None, 0
        kept = self._collector.complete(pair, predicted, residual)
        due = kept and self._retraining.pair_added()
        if due or self._collector.waiting >= PAIRS_PER_FILE:
            self._write()

    def _write(self) -> None:
        if not self._collector.waiting:
            return
        try:
            self._collector.take().append_to(self._dataset)
        except InputError as error:
            self.get_logger().error(f'training pairs lost: {error}')

    def _retrain(self) -> None:
        self._retraining.started(time.monotonic())
        goal = Train.Goal(
            dataset=str(self._dataset),
            output=self._output,
            architecture=self._architecture,
            seed=self._seed,
        )
        self._voucher.vouch(senders.goals_of(TRAIN), goal)
        sent = self._train.send_goal_async(
            goal, lambda _: self._retraining.reported(time.monotonic())
        )
        sent.add_done_callback(self._on_goal_answer)

    def _on_goal_answer(self, future: Future) -> None:
        handle = future.result()
        if not handle.accepted:
            # another client has COSTA trained at this moment, or could send goals
            self._retraining.refused(time.monotonic())
            return
        handle.get_result_async().add_done_callback(self._on_trained)

    def _on_trained(self, future: Future) -> None:
        if self._foreign(senders.goals_of(TRAIN)):
            self._retraining.refused(time.monotonic())
            return
        self._retraining.finished()
        result = future.result().result
        if result.outcome.code != Outcome.OK:
            self.get_logger().error(f'training failed: {result.outcome.message}')
            return
        self.get_logger().info(
            f'trained on {result.samples} pairs, {result.epochs} epochs, '
            f'validation loss {result.validation_loss:.3f}'
        )


def _dataset_folder(text: str) -> Path:
    if not text:
        raise InputError('trainer without a data set: give its parameter dataset, a folder')
    return Path(text)


def known_pairs(folder: Path, grid: Grid, time_step: float, physics: PhysicsId) -> Dataset | None:
    """Return the pairs that a trainer has collected before in `folder`, or None.

    Raises:
        InputError: the pairs are on another grid, of another time step [s] or another physics.
    """
    if not dataset_parts(folder):
        return None
    known = load_dataset(folder)
    if known.grid != grid or known.time_step != time_step:
        raise InputError(
            f'{folder}: holds pairs on {known.grid} every {known.time_step:g} s, the '
            f'twin runs on {grid} every {time_step:g} s; name another folder'
        )
    if difference := known.physics.difference(physics):
        raise InputError(f'{folder}: holds pairs of {difference}; name another folder')
    return known


def main() -> None:
    """Run the node in one thread, so that no two callbacks run at the same time."""
    run(only_one(TrainerNode, 'trainer'), threads=1)


if __name__ == '__main__':
    main()
