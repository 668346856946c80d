"""The page as a node: stores what the graph says, serves it, and passes confirmations on."""

import threading
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from porotwin_core import conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.node import Diagnostics, declare, run
from porotwin_core.rig import load_rig
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    NewState,
    Outcome,
    RigDescription,
    Setpoint,
    TracerField,
    WellRates,
)
from porotwin_msgs.srv import ConfirmRates
from porotwin_page import address, snapshot
from porotwin_page.board import Board
from porotwin_page.confirmation import Confirmation
from porotwin_page.server import ConfirmationUnavailable, PageApplication, ServerThread

LEVELS = {
    DiagnosticStatus.OK: snapshot.Level.OK,
    DiagnosticStatus.WARN: snapshot.Level.WARN,
}
LOOK_AROUND_PERIOD = 2.0
"""How often the node looks which nodes the graph shows [s]."""

CONFIRM_TIMEOUT = 5.0
"""Longest wait for the operator node's answer [s]."""


class PageNode(Node):
    """Shows the graph to people; changes nothing but what they confirm."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and begin to serve.

        Raises:
            InputError: a parameter or the rig description is wrong, or the address is in use.
        """
        super().__init__('page', **kwargs)
        self._board = Board()
        rig = declare(self, 'rig', '', 'path of rig.yaml; empty: wait for rig/description')
        if rig:
            self._board.apply(snapshot.with_rig, load_rig(rig))
        asked = declare(self, 'address', '127.0.0.1:8765', 'HOST:PORT to serve at')
        listening = address.listen(asked)
        self._confirm_client = self.create_client(ConfirmRates, 'operator/confirm')
        self._diagnostics = Diagnostics(self)
        self._make_subscriptions()
        self._application = PageApplication(self._board, self._confirm, self._graph_time)
        self._server = ServerThread(self._application.make(), listening)
        host, port = address.parse(asked)[0], listening.getsockname()[1]
        self._place = f'http://{f"[{host}]" if ":" in host else host}:{port}'
        self.get_logger().info(f'page at {self._place}')
        if not address.is_local(host):
            self.get_logger().warning(
                'everyone who reaches this machine can see the page and confirm rates'
            )
        # not on the graph's clock: that may stand still
        self.create_timer(
            LOOK_AROUND_PERIOD, self._look_around, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _make_subscriptions(self) -> None:
        for message_type, topic, callback, profile in (
            (RigDescription, 'rig/description', self._on_rig, qos.CONFIG),
            (NewState, 'asset/new_state', self._on_new_state, qos.FIELD),
            (CleanState, 'asset/clean_state', self._on_clean_state, qos.FIELD),
            (TracerField, 'tracer/predicted', self._on_predicted, qos.FIELD),
            (TracerField, 'tracer/corrected', self._on_corrected, qos.FIELD),
            (Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT),
            (WellRates, 'wells/measured', self._on_measured, qos.FIELD),
            (CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD),
            (DiagnosticArray, '/diagnostics', self._on_diagnostics, 10),
        ):
            self.create_subscription(message_type, topic, self._checked(topic, callback), profile)

    def _checked(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def checked(message: Any) -> None:
            try:
                callback(message)
            except ValueError as error:
                line = ' '.join(str(error).split())
                self.get_logger().error(f'{topic} not shown: {line}')

        return checked

    def _graph_time(self) -> float | None:
        now = self.get_clock().now().nanoseconds
        return now * 1e-9 if now > 0 else None

    def _on_rig(self, message: RigDescription) -> None:
        self._board.apply(snapshot.with_rig, conversions.rig_from_msg(message))

    def _map(self, message: TracerField) -> snapshot.Map:
        concentration, grid = conversions.tracer_from_msg(message)
        return snapshot.Map(conversions.time_from_msg(message.header.stamp), concentration, grid)

    def _on_new_state(self, message: NewState) -> None:
        observation = snapshot.Observation(
            sequence=message.sequence,
            map=self._map(message.tracer),
            arrival=time.monotonic(),
            time_step=message.time_step,
            noise=message.noise,
            calibrated=message.calibrated,
            remarks=tuple(message.remarks),
        )
        self._board.apply(snapshot.with_observation, observation)

    def _on_clean_state(self, message: CleanState) -> None:
        at = conversions.time_from_msg(message.header.stamp)
        if message.cause == CleanState.START:
            self._board.apply(snapshot.with_new_experiment, at)
        elif message.cause == CleanState.FINISHED:
            self._board.apply(snapshot.with_end, message.reason)
        else:
            self._board.apply(snapshot.with_interruption, snapshot.Mark(at, message.reason))

    def _on_predicted(self, message: TracerField) -> None:
        self._board.apply(snapshot.with_predicted, self._map(message))

    def _on_corrected(self, message: TracerField) -> None:
        self._board.apply(snapshot.with_corrected, self._map(message))

    def _on_setpoint(self, message: Setpoint) -> None:
        setpoint = snapshot.Setpoint(
            sequence=message.sequence,
            time=conversions.time_from_msg(message.header.stamp),
            valid_until=conversions.time_from_msg(message.valid_until),
            rates=conversions.rates_from_msg(message.wells),
            reason=message.reason,
            arrival=self._graph_time(),
        )
        self._board.apply(snapshot.with_setpoint, setpoint)

    def _on_measured(self, message: WellRates) -> None:
        rates = conversions.rates_from_msg(message.wells)
        by_person = message.start == message.header.stamp
        self._board.apply(snapshot.with_measured, rates, by_person=by_person)

    def _on_cycle(self, message: CycleReport) -> None:
        point = snapshot.CyclePoint(
            time=conversions.time_from_msg(message.header.stamp),
            prediction_error=message.prediction_error,
            corrected_error=message.corrected_error,
            disallowed_tracer=message.disallowed_tracer,
            cycle_duration=message.cycle_duration,
            corrected=message.corrected,
            correction_status=message.correction_status,
            remarks=tuple(message.remarks),
        )
        self._board.apply(snapshot.with_cycle, point)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            level = LEVELS.get(status.level, snapshot.Level.ERROR)
            said = snapshot.Health(level, status.message, now)
            self._board.apply(snapshot.with_health, status.name.rpartition('/')[2], said)

    def _look_around(self) -> None:
        names = [
            name
            for name, namespace in self.get_node_names_and_namespaces()
            if namespace == self.get_namespace() and not name.startswith('_')
        ]
        self._board.apply(snapshot.with_nodes, names, time.monotonic())
        count = self._application.streams
        self._diagnostics.report(
            DiagnosticStatus.OK, f'{self._place}, {count} {"browser" if count == 1 else "browsers"}'
        )

    def _confirm(self, given: Confirmation) -> str:
        """Ask the operator node; runs in a thread of the server, never in the executor's."""
        client = self._confirm_client
        if not client.wait_for_service(timeout_sec=1.0):
            raise ConfirmationUnavailable('nobody takes confirmations: the operator node is absent')
        answered = threading.Event()
        wells = conversions.rates_to_msg(given.rates)
        future = client.call_async(ConfirmRates.Request(sequence=given.sequence, wells=wells))
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(CONFIRM_TIMEOUT):
            client.remove_pending_request(future)
            raise ConfirmationUnavailable(
                f'the operator node did not answer within {CONFIRM_TIMEOUT:g} s; try again'
            )
        outcome = future.result().outcome
        if outcome.code != Outcome.OK:
            raise InputError(outcome.message)
        self._board.apply(snapshot.with_confirmation, given.sequence)
        return f'setpoint {given.sequence} confirmed'

    def destroy_node(self) -> None:
        """End serving, then the node."""
        self._server.close()
        super().destroy_node()


def main() -> None:
    """Run the node."""
    run(PageNode)


if __name__ == '__main__':
    main()
