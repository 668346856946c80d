"""The pumps as a node: it takes the guard's setpoints and publishes the delivered rates."""

from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_msgs.msg import Header

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import HEARTBEAT_S
from porotwin_core.clock.stamps import believed_age, steady_time
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.node import Diagnostics, TwinNode, declare, declare_rig, run
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_msgs.msg import Setpoint, WellRates
from porotwin_msgs.srv import Control, Ping
from porotwin_pumps.bridge import PumpBridge
from porotwin_pumps.protocols.pump_protocol import PumpError
from porotwin_pumps.pump_file import load_pumps, pump_openers


class PumpsNode(TwinNode):
    """Sets real pumps for the guard, watches them, and measures their rates."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and set the safe rates; `kwargs` are for the node.

        Raises:
            InputError: a parameter, the rig description or the file of the pumps is wrong.
        """
        super().__init__('pumps', **kwargs)
        rig = declare_rig(self)
        path = Path(declare(self, 'pumps', '', 'path of the pump file'))
        self._period = declare(
            self, 'measure_period_s', 30.0, 'time over which rates are measured [s]',
            at_least=1.0, at_most=3600.0, on_change=self._set_period,
        )  # fmt: skip
        entries = load_pumps(path, rig)
        self._ahead = 0.0
        """Time of the photographs' clock ahead of this node's clock [s]."""
        self._measured_at = steady_time()
        self._diagnostics = Diagnostics(self)
        self._bridge = PumpBridge(
            rig,
            pump_openers(entries),
            max_rates_ml_h={well: entry.max_rate_ml_h for well, entry in entries.items()},
            now=steady_time(),
        )
        self._began: float | None = None
        """Start of the experiment by the photographs' clock [s]; None: imaging has told none."""
        follow(self, Header, 'asset/experiment', self._on_experiment, qos.CONFIG)
        self._measured = self.create_publisher(WellRates, 'wells/measured', qos.FIELD)
        self._guard = OnlyCaller(self, 'asset/control')
        self.create_service(Control, 'asset/control', self._on_control)
        self.create_service(Ping, 'asset/ping', self._on_ping)
        self.create_timer(HEARTBEAT_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._report(f'{len(entries)} pumps at the safe rates')

    def _set_period(self, seconds: float) -> None:
        self._period = seconds

    def _on_experiment(self, message: Header) -> None:
        self._began = conversions.time_from_msg(message.stamp)

    def _tell_elapsed(self) -> None:
        """Tell the bridge how old the experiment is, for the announced pauses."""
        if self._began is not None:
            self._bridge.elapsed = max(self.now() + self._ahead - self._began, 0.0)

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        setpoint = request.setpoint
        try:
            self._guard.check(request)
            rates = conversions.rates_from_msg(setpoint.wells)
            remaining = self._remaining(setpoint)
            self._publish_measurement()
            self._tell_elapsed()
            now = steady_time()
            self._bridge.command(rates, until=now + remaining, now=now)
        except (InputError, PumpError) as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'setpoint {setpoint.sequence} not pumped: {error}')
            self._report(f'setpoint {setpoint.sequence} not pumped: {error}', failed=True)
            return response
        self._report(f'setpoint {setpoint.sequence} is pumped')
        response.outcome = conversions.ok()
        return response

    def _remaining(self, setpoint: Setpoint) -> float:
        """Return how long a setpoint still holds [s].

        Raises:
            InputError: it has expired.
        """
        taken = conversions.time_from_msg(setpoint.header.stamp)
        until = conversions.time_from_msg(setpoint.valid_until)
        validity = until - taken
        if not validity > 0.0:
            raise InputError('it ends before its photograph')
        now = self.now()
        age = believed_age(taken, now, validity)
        self._ahead = age - (now - taken)
        return validity - age

    def _tick(self) -> None:
        self._tell_elapsed()
        line = self._bridge.tick(steady_time())
        if line is not None:
            self.get_logger().warning(line)
            self._report(line, failed=bool(self._bridge.faults))
        if steady_time() - self._measured_at >= self._period:
            self._publish_measurement()

    def _publish_measurement(self) -> None:
        now = steady_time()
        self._measured_at = now
        measured = self._bridge.measure(now)
        if measured is None:
            return
        end = self.now() + self._ahead
        self._measured.publish(
            WellRates(
                header=conversions.header_at(end),
                start=conversions.time_to_msg(end - measured.duration),
                wells=conversions.rates_to_msg(measured.rates),
            )
        )

    def _report(self, text: str, *, failed: bool = False) -> None:
        faults = self._bridge.faults
        level = DiagnosticStatus.ERROR if failed or faults else DiagnosticStatus.OK
        self._diagnostics.report(level, text, **faults)

    def _on_ping(self, request: Ping.Request, response: Ping.Response) -> Ping.Response:
        response.name = 'pumps'
        response.version = __version__
        response.status = f'{len(self._bridge.faults)} pumps do not work'
        response.time = self.get_clock().now().to_msg()
        return response

    def destroy_node(self) -> None:
        """Set the safe rates and end the node."""
        if hasattr(self, '_bridge'):
            self._bridge.go_safe(steady_time())
        super().destroy_node()


def main() -> None:
    """Run the node."""
    # one thread: setpoints and looks at the pumps share the serial lines
    run(only_one(PumpsNode, 'pumps'))


if __name__ == '__main__':
    main()
