"""Real COSTA nodes in processes of their own, and a client that plays asset, solver and hub."""

import itertools
import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import rclpy
from patience import PATIENCE_S, until
from rcl_interfaces.srv import ListParameters
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup

from porotwin_core.basis.errors import InputError
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.senders import TERMINAL, goals_of
from porotwin_core.ros.vouching import CALLERS, Voucher
from porotwin_costa.data.frames import Frames
from porotwin_msgs.action import Train
from porotwin_msgs.msg import CleanState, NewState, Outcome, WellRates
from porotwin_msgs.srv import Predict, Residual

GRID = '30x20'

ASKED_EACH_S = 10.0
"""A node that gives no answer in this time [s] is asked again."""

HIDDEN = slice(6, 9)
"""Columns behind a tube: never seen."""


class Client:
    """A node of the test that runs in a thread."""

    def __init__(self) -> None:
        context = rclpy.Context()
        rclpy.init(context=context)
        self.node = rclpy.create_node('virtual_rig', context=context)
        self.solver = rclpy.create_node('solver', context=context)
        self.group = ReentrantCallbackGroup()
        self._terminal = rclpy.create_node(TERMINAL, context=context)
        self.voucher = Voucher(self._terminal)
        # two clients of a service look like two nodes of a name
        self._clients: dict[str, Any] = {}
        self._thread = NodeThread(self.node, self.solver, self._terminal, threads=3)

    def wait(self, future: Any, patience_s: float = PATIENCE_S) -> Any:
        """Return the result of a future."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(patience_s), f'no answer in {patience_s} s'
        return future.result()

    def call(
        self,
        service: Any,
        name: str,
        request: Any,
        *,
        vouched: bool = True,
        patience_s: float = PATIENCE_S,
    ) -> Any:
        """Return the answer of a service, once it is there; vouch where that is needed."""
        if name not in self._clients:
            node = self._terminal if name in CALLERS else self.node
            made = node.create_client(service, name, callback_group=self.group)
            self._clients[name] = made
        client = self._clients[name]
        assert client.wait_for_service(PATIENCE_S), f'{name} absent after {PATIENCE_S} s'
        if vouched and name in CALLERS:
            self.voucher.vouch(name, request)
        return self.wait(client.call_async(request), patience_s)

    def action(self, *, vouched: bool = True, **goal: Any) -> tuple[Any, list[Any]]:
        """Send a training goal; return its handle and a list that grows with its feedback."""
        feedback: list[Any] = []
        name, request = 'costa/train', Train.Goal(**goal)
        if name not in self._clients:
            made = ActionClient(self._terminal, Train, name, callback_group=self.group)
            self._clients[name] = made
        client = self._clients[name]
        assert client.wait_for_server(PATIENCE_S)
        if vouched:
            self.voucher.vouch(goals_of(name), request)
        handle = self.wait(client.send_goal_async(request, lambda m: feedback.append(m.feedback)))
        return handle, feedback

    def until(
        self, reason: str, condition: Callable[[], bool], node: subprocess.Popen | None = None
    ) -> None:
        """Return when `condition` holds; else fail with `reason` and the output of `node`."""
        until(condition, lambda: f'{reason}\n{stop(node) if node else ""}')

    def spin(self, node: Any) -> None:
        """Call the callbacks of `node` as well, until the end."""
        self._thread.executor.add_node(node)

    def close(self) -> None:
        """End the node."""
        self._thread.end()


def start(module: str, *, namespace: str = '/', **parameters: Any) -> subprocess.Popen:
    """Start a node of COSTA on the toy grid with these parameters."""
    parameters = {'grid': GRID, **parameters}
    arguments = [f'{name}:={value}' for name, value in parameters.items()]
    flags = [part for argument in arguments for part in ('-p', argument)]
    flags += ['-r', f'__ns:={namespace}']
    return subprocess.Popen(
        [sys.executable, '-m', f'porotwin_costa.{module}', '--ros-args', *flags],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, 'PYTHONFAULTHANDLER': '1'},
    )


def stop(process: subprocess.Popen) -> str:
    """End a node as Ctrl-C does; return its output, with its stacks if it does not end."""
    process.send_signal(signal.SIGINT)
    try:
        out, errors = process.communicate(timeout=20)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)
        out, errors = process.communicate()
    return out + errors


def offer_solver(client: Client, model: Any) -> list[Any]:
    """Offer the services of a solver with a toy model; return them.

    The first request is cancelled, as if another client had asked for it.
    """
    requests = itertools.count()

    def answer(field: str, convert: Callable, work: Callable) -> Callable:
        def callback(request: Any, response: Any) -> Any:
            if next(requests) == 0:
                response.outcome = Outcome(code=Outcome.FAILED, message='cancelled')
                return response
            values = conversions.tracer_from_msg(request.previous)[0]
            rates = conversions.rates_from_msg(request.wells)
            try:
                result = work(request, values, rates)
            except InputError as error:
                response.outcome = conversions.refusal(error)
                return response
            setattr(response, field, convert(result, model.grid, 0.0))
            return response

        return callback

    def predict(request: Any, previous: np.ndarray, rates: dict) -> np.ndarray:
        return model.predict(previous, rates, conversions.seconds_from_msg(request.time_step))

    def residual(request: Any, previous: np.ndarray, rates: dict) -> np.ndarray:
        following = conversions.tracer_from_msg(request.next)[0]
        return model.residual(
            previous, following, rates, conversions.seconds_from_msg(request.time_step)
        )

    make = client.solver.create_service
    return [
        make(
            Predict,
            'solver/predict',
            answer('predicted', conversions.tracer_to_msg, predict),
            callback_group=client.group,
        ),
        make(
            Residual,
            'solver/residual',
            answer('residual', conversions.source_to_msg, residual),
            callback_group=client.group,
        ),
    ]


class Asset:
    """Publishes states, measured rates and clean states, as the asset does."""

    def __init__(self, client: Client, model: Any) -> None:
        self._imaging, self._operator = (
            rclpy.create_node(name, context=client.node.context) for name in ('imaging', 'operator')
        )
        self._states = self._imaging.create_publisher(NewState, 'asset/new_state', qos.FIELD)
        self._clean = self._imaging.create_publisher(CleanState, 'asset/clean_state', qos.FIELD)
        self._measured = self._operator.create_publisher(WellRates, 'wells/measured', qos.FIELD)
        self._client, self._grid = client, model.grid
        self._sequence = 0

    def wait_for_trainer(self, trainer: subprocess.Popen) -> None:
        """Return when `trainer` receives the messages."""
        publishers = (self._states, self._measured, self._clean)
        self._client.until(
            'the trainer has no subscriptions',
            lambda: all(one.get_subscription_count() for one in publishers),
            trainer,
        )

    def state(self, time_s: float, concentration: np.ndarray) -> None:
        """Publish a state (nz, nx)."""
        header = conversions.header_at(time_s)
        tracer = conversions.tracer_to_msg(concentration, self._grid, time_s)
        self._states.publish(NewState(header=header, sequence=self._sequence, tracer=tracer))
        self._sequence += 1

    def experiment(self, frames: Frames, begin: float, count: int) -> None:
        """Publish `count` frames from `begin` [s] on, after an interruption; a tube hides some."""
        self._clean.publish(
            CleanState(header=conversions.header_at(begin), cause=0, reason=frames.name)
        )
        for n in range(count):
            start, end = frames.times[n], frames.times[n + 1]
            rates = conversions.rates_to_msg(frames.schedule.mean(start, end))
            self._measured.publish(
                WellRates(
                    header=conversions.header_at(begin + end),
                    start=conversions.time_to_msg(begin + start),
                    wells=rates,
                )
            )
            seen = frames.concentration[n].copy()
            seen[:, HIDDEN] = np.nan
            self.state(begin + start, seen)
            self._wait_for_trainer()

    def _wait_for_trainer(self) -> None:
        """Return when the trainer has taken one message of each topic that waits there.

        DDS loses an answer to a client that the trainer does not know yet: it is asked again.
        """
        for _ in range(math.ceil(PATIENCE_S / ASKED_EACH_S)):
            with suppress(AssertionError):
                self._client.call(
                    ListParameters,
                    'trainer/list_parameters',
                    ListParameters.Request(),
                    patience_s=ASKED_EACH_S,
                )
                return
        raise AssertionError(f'the trainer gives no answer in {PATIENCE_S} s')

    def close(self) -> None:
        """End the node, so that the next asset is the only one."""
        self._imaging.destroy_node()
        self._operator.destroy_node()

    def finish(self) -> None:
        """Publish the end of the experiment, after all that was published before it."""
        for _ in range(self._sequence):
            self._wait_for_trainer()
        self._clean.publish(CleanState(cause=CleanState.FINISHED, reason='finished'))
