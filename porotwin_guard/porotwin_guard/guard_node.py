"""The node of the guard: takes setpoints of the hub, checks them, and sends them to the pumps."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rosgraph_msgs.msg import Clock as ClockMessage

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import HEARTBEAT_S
from porotwin_core.ros import conversions, qos, senders
from porotwin_core.ros.following import follow
from porotwin_core.ros.node import (
    Diagnostics,
    TwinNode,
    declare,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.senders import LONGEST_SEARCH_S
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_core.ros.single_instance import another_lives, only_one
from porotwin_core.ros.vouching import OnlyCaller, Voucher
from porotwin_guard.guard import Guard, SetpointRequest
from porotwin_msgs.msg import Outcome, Setpoint
from porotwin_msgs.srv import Control

BLOCKED = 'no setpoint can pass: '
"""Begin of the line about a foreign sender."""


class GuardNode(TwinNode):
    """Checks every setpoint of the hub, hands it to the pumps, and publishes what they took."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters; `kwargs` are for the node, such as `context`.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('guard', **kwargs)
        interval = declare_photo_interval(self)
        self._guard = Guard(declare_rig(self), photo_interval=interval)
        self._patience = declare(
            self, 'asset_timeout_s', 10.0, 'longest wait for the pumps [s]', at_least=0.1,
            at_most=120.0,
        )  # fmt: skip
        self._diagnostics = Diagnostics(self)
        self._health = (DiagnosticStatus.OK, 'no setpoint yet')
        self._setpoints = self.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
        # the answer of the pumps arrives while the request of the hub waits for it
        self._pumps = self.create_client(
            Control, 'asset/control', callback_group=MutuallyExclusiveCallbackGroup()
        )
        self._hub = OnlyCaller(self, 'guard/control')
        self._voucher = Voucher(self)
        self.create_service(
            Control, 'guard/control', self._on_control,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )  # fmt: skip
        self._simulated_time: float | None = None
        if self.simulated:
            follow(self, ClockMessage, '/clock', self._on_clock, qos.CLOCK)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(HEARTBEAT_S, self._watch, clock=steady)

    def _on_clock(self, message: ClockMessage) -> None:
        self._simulated_time = conversions.time_from_msg(message.clock)

    def _now(self) -> float:
        """Return the time [s] by a steady clock, or of the run in simulated time.

        Raises:
            InputError: the time is not known, or a foreign node could tell it.
        """
        if not self.simulated:
            return self.now()
        senders.check_senders(self, '/clock')
        if self._simulated_time is None:
            raise InputError('nobody publishes /clock, so no age of a photograph is known')
        return self._simulated_time

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        setpoint = request.setpoint
        try:
            self._check_alone()
            wanted, now = self._request(request), self._now()
            self._guard.check(wanted, now=now)
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self._say(DiagnosticStatus.ERROR, f'setpoint {setpoint.sequence} refused: {error}')
            return response
        response.outcome = self._command(request)
        if response.outcome.code == Outcome.OK:
            self._guard.take(wanted, now=now)
            self._setpoints.publish(setpoint)
            self._say(DiagnosticStatus.OK, f'setpoint {setpoint.sequence} passed')
        else:
            text = f'setpoint {setpoint.sequence} not pumped: {response.outcome.message}'
            self._say(DiagnosticStatus.ERROR, text)
        return response

    def _request(self, request: Control.Request) -> SetpointRequest:
        message, hub = request.setpoint, self._hub.check(request)
        return SetpointRequest(
            sequence=message.sequence,
            stamp=conversions.time_from_msg(message.header.stamp),
            valid_until=conversions.time_from_msg(message.valid_until),
            rates=conversions.rates_from_msg(message.wells),
            hub=hub.identity,
        )

    def _check_alone(self) -> None:
        """Check that no other node publishes setpoints.

        Raises:
            InputError: another node does; one line with its name.
        """
        found = senders.publishers(self, 'wells/setpoint')
        senders.refuse_others(self, found, [senders.GUARD], 'publishes wells/setpoint')
        if another := another_lives(self):
            raise InputError(another)

    def _command(self, request: Control.Request) -> Outcome:
        """Return the answer of the pumps to a setpoint that has passed."""
        if not self._pumps.wait_for_service(timeout_sec=min(self._patience, LONGEST_SEARCH_S)):
            return Outcome(code=Outcome.NOT_READY, message='no node answers asset/control')
        self._voucher.vouch('asset/control', request)
        try:
            response = twin_answer_within(self, self._pumps, request, self._patience)
        except InputError as error:
            return Outcome(code=Outcome.FAILED, message=str(error))
        if response is None:
            text = f'asset/control did not answer within {self._patience:g} s'
            return Outcome(code=Outcome.FAILED, message=text)
        return response.outcome

    def _watch(self) -> None:
        """Report a foreign sender, or the end of the last setpoint, once."""
        try:
            self._check_alone()
            self._hub.present()
            heard = not self.simulated or self._simulated_time is not None
            expired = self._guard.expired(self._now()) if heard else None
        except InputError as error:
            self._say(DiagnosticStatus.ERROR, f'{BLOCKED}{error}')
            return
        if expired is not None:
            text = f'setpoint {expired} has expired and none followed; the safe rates hold'
            self._say(DiagnosticStatus.WARN, text)
        elif self._health[1].startswith(BLOCKED):
            self._say(DiagnosticStatus.OK, 'setpoints can pass again')

    def _say(self, level: bytes, text: str) -> None:
        """Report the health of the node, and log it, if it has changed."""
        if (level, text) == self._health:
            return
        self._health = (level, text)
        self._diagnostics.report(level, text)
        if level == DiagnosticStatus.WARN:
            self.get_logger().warning(text)
        elif level == DiagnosticStatus.ERROR:
            self.get_logger().error(text)


def main() -> None:
    """Run the node, unless another guard runs."""
    run(only_one(GuardNode, senders.GUARD))


if __name__ == '__main__':
    main()
