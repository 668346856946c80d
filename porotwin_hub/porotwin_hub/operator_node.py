"""The bridge to the person at the pumps: shows, speaks and confirms setpoints.

Beside a real rig it also stands for the asset: it answers `asset/ping` and takes `asset/control`
by passing the setpoint on to the operator, as the paper's audio link did.
"""

import queue
import shutil
import subprocess
import threading
import time
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from std_msgs.msg import String

from porotwin_core import __version__, conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.node import declare, declare_rig, run
from porotwin_core.wells import WellRate
from porotwin_hub.announcement import Announcement, announce, announce_expiry
from porotwin_hub.control import Limits
from porotwin_msgs.msg import Setpoint, WellRates
from porotwin_msgs.srv import ConfirmRates, Control, Ping

REMEMBERED = 100
"""Setpoints that can still be confirmed."""

EXPIRY_PERIOD_S = 1.0
"""How often the node looks whether the newest setpoint has expired [s]."""


class Voice:
    """Speaks through espeak-ng, one sentence after the other, never blocking; silent without it."""

    def __init__(self) -> None:
        self.program = shutil.which('espeak-ng')
        self._sentences: queue.Queue[str] = queue.Queue()
        if self.program is not None:
            threading.Thread(target=self._speak, daemon=True).start()

    def say(self, sentence: str) -> None:
        """Queue a sentence; an older one that was not begun yet is dropped, it is out of date."""
        if self.program is None:
            return
        while not self._sentences.empty():
            self._sentences.get_nowait()
        self._sentences.put(sentence)

    def _speak(self) -> None:
        assert self.program is not None
        while True:
            subprocess.run(
                [self.program, self._sentences.get()], check=False, stderr=subprocess.DEVNULL
            )


class OperatorNode(Node):
    """Announces setpoints and takes the operator's word for what was set."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('operator', **kwargs)
        rig = declare_rig(self)
        self._limits = Limits.of(rig) if rig.control is not None else None
        self._wells = tuple(rig.wells)
        stands_for_asset = declare(self, 'asset', False, 'answer asset/control for a person')
        self._voice = Voice() if declare(self, 'speak', False, 'speak with espeak-ng') else None
        if self._voice is not None and self._voice.program is None:
            self.get_logger().warning('no espeak-ng on this machine, so no speech: apt install it')
        self._asked: dict[int, dict[str, WellRate]] = {}
        self._newest: dict[str, WellRate] = {}
        self._expiry: tuple[int, float] | None = None
        self._camera_ahead = 0.0
        self._simulated = bool(self.get_parameter('use_sim_time').value)
        self._announcements = self.create_publisher(String, 'operator/announcement', qos.FIELD)
        self._measured = self.create_publisher(WellRates, 'wells/measured', qos.FIELD)
        self.create_subscription(Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT)
        self.create_service(ConfirmRates, 'operator/confirm', self._on_confirm)
        if stands_for_asset:
            self.create_service(Control, 'asset/control', self._on_control)
            self.create_service(Ping, 'asset/ping', self._on_ping)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(EXPIRY_PERIOD_S, self._on_timer, clock=steady)

    def _on_setpoint(self, message: Setpoint) -> None:
        try:
            rates, validity = self._checked(message)
        except InputError as error:
            self.get_logger().error(f'setpoint {message.sequence} not shown: {error}')
            return
        if message.sequence <= max(self._asked, default=0):
            self._asked.clear()  # the hub was started again and counts from one
        self._asked[message.sequence] = rates
        while len(self._asked) > REMEMBERED:
            del self._asked[next(iter(self._asked))]
        # from its arrival on: the photograph's stamp is by another clock
        self._expiry = (message.sequence, self._now() + validity)
        self._camera_ahead = conversions.time_from_msg(message.header.stamp) - self._now()
        self._say(announce(message.sequence, rates, self._newest))
        self._newest = rates

    def _checked(self, message: Setpoint) -> tuple[dict[str, WellRate], float]:
        """Return the rates of a setpoint and for how long they hold [s].

        Raises:
            InputError: rates or times are not valid, or break a limit of the rig.
        """
        rates = conversions.rates_from_msg(message.wells)
        self._refuse_broken_limits(rates)
        taken = conversions.time_from_msg(message.header.stamp)
        until = conversions.time_from_msg(message.valid_until)
        if until < taken:
            raise InputError(f'valid until {until:.3f} s, before its photograph at {taken:.3f} s')
        return rates, until - taken

    def _refuse_broken_limits(self, rates: dict[str, WellRate]) -> None:
        broken = self._limits.violations(rates) if self._limits is not None else []
        if broken:
            raise InputError('; '.join(broken))

    def _now(self) -> float:
        """Return the time [s] by a clock that nobody sets, or by the simulation's."""
        if self._simulated:
            return float(self.get_clock().now().nanoseconds) * 1e-9
        return time.monotonic()

    def _on_timer(self) -> None:
        """Say once that a setpoint has expired without a successor, and what holds now."""
        if self._expiry is None or self._now() <= self._expiry[1]:
            return
        sequence, self._expiry = self._expiry[0], None
        safe = self._limits.safe() if self._limits is not None else {}
        self._say(announce_expiry(sequence, safe, self._newest))
        if safe:
            self._asked[sequence] = self._newest = safe  # what to confirm as done is now this

    def _say(self, words: Announcement) -> None:
        print(words.text, flush=True)
        self._announcements.publish(String(data=words.speech))
        if self._voice is not None and words.changed:
            self._voice.say(words.speech)

    def _on_confirm(
        self, request: ConfirmRates.Request, response: ConfirmRates.Response
    ) -> ConfirmRates.Response:
        try:
            rates = self._confirmed(request)
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'confirmation refused: {error}')
            return response
        # by the clock of the photographs, as all that is compared with them
        now = conversions.time_to_msg(self._now() + self._camera_ahead)
        message = WellRates(start=now, wells=conversions.rates_to_msg(rates))
        message.header.stamp = now
        message.header.frame_id = conversions.RIG_FRAME
        self._measured.publish(message)
        response.outcome = conversions.ok()
        return response

    def _confirmed(self, request: ConfirmRates.Request) -> dict[str, WellRate]:
        if request.sequence not in self._asked:
            known = f'the newest is {max(self._asked)}' if self._asked else 'there was none yet'
            raise InputError(f'setpoint {request.sequence} is not known; {known}')
        given = conversions.rates_from_msg(request.wells)
        for well in given:
            if well not in self._wells:
                raise InputError(
                    f"well '{well}' is not in the rig; known: {', '.join(self._wells)}"
                )
        return {**self._asked[request.sequence], **given}

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        try:
            self._checked(request.setpoint)
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'setpoint {request.setpoint.sequence} refused: {error}')
            return response
        response.outcome = conversions.ok()
        return response

    def _on_ping(self, request: Ping.Request, response: Ping.Response) -> Ping.Response:
        response.name = 'operator'
        response.version = __version__
        response.status = 'a person at the pumps'
        response.time = self.get_clock().now().to_msg()
        return response


def main() -> None:
    """Run the node."""
    run(OperatorNode)


if __name__ == '__main__':
    main()
