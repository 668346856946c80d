"""The bridge to the person at the pumps: shows, speaks and confirms setpoints.

Beside a real rig it also stands for the asset: it answers `asset/ping`, and it takes
`asset/control` by passing the setpoint on to the operator, as the paper's audio link did.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_msgs.msg import String

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import HEARTBEAT_S
from porotwin_core.clock.stamps import believed_age
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.foreign_words import FewWords, in_short, said
from porotwin_core.ros.node import TwinNode, declare, declare_rig, run
from porotwin_core.ros.run_topics import follow_start
from porotwin_core.ros.senders import SENDERS
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_hub.operator.announcement import (
    BY_THE_PUMPS,
    NO_SETPOINT,
    Announcement,
    confirmation_in_words,
)
from porotwin_hub.operator.setpoint_book import SetpointBook, ShownSetpoint
from porotwin_hub.operator.voice import Voice
from porotwin_msgs.msg import CycleReport, MendOffer, Setpoint, WellRates
from porotwin_msgs.srv import ConfirmRates, Control, Ping

HUB, MEND = 'hub', 'mend'
"""The nodes whose words the operator reads and hears."""


class OperatorNode(TwinNode):
    """Announces setpoints and publishes the rates that the operator confirms."""

    def __init__(self, *, clock: Callable[[], float] | None = None, **kwargs: Any) -> None:
        """Read the parameters.

        Args:
            clock: the time [s] for expiry; None: a clock that nobody sets, or simulated time.
            kwargs: for the node, such as `context` and `parameter_overrides`.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('operator', **kwargs)
        rig = declare_rig(self)
        self._simulated = self.simulated
        self._now = clock or self.now
        self._book = SetpointBook(rig)
        stands_for_asset = declare(self, 'asset', False, 'answer asset/control for a person')
        self._voice: Voice | None = None
        self._let_speak(
            declare(self, 'speak', False, 'speak with espeak-ng', on_change=self._let_speak)
        )
        self._words = FewWords(_print, known=(HUB, MEND))
        self._refusals = FewWords(self.get_logger().error, known=SENDERS)
        self._told: frozenset[str] = frozenset()
        self._announcements = self.create_publisher(String, 'operator/announcement', qos.FIELD)
        self._measured = self.create_publisher(WellRates, 'wells/measured', qos.FIELD)
        listen = partial(follow, self, refuse=self._refusals.tell)
        # nobody sets a pump by a recording
        listen(Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT, replayed=False)
        listen(CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        listen(MendOffer, 'mend/offer', self._on_offer, qos.CONFIG)
        follow_start(self, self._on_start)
        self._page = OnlyCaller(self, 'operator/confirm')
        # a forged request is waited for, and a setpoint must not wait for it
        apart = MutuallyExclusiveCallbackGroup()
        self.create_service(
            ConfirmRates, 'operator/confirm', self._on_confirm, callback_group=apart
        )
        if stands_for_asset:
            self._guard = OnlyCaller(self, 'asset/control')
            self.create_service(Control, 'asset/control', self._on_control)
            self.create_service(Ping, 'asset/ping', self._on_ping)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(HEARTBEAT_S, self._on_timer, clock=steady)

    def _let_speak(self, speak: bool) -> None:
        self._voice = Voice(on_problem=self.get_logger().warning) if speak else None
        if self._voice is not None and self._voice.program is None:
            self.get_logger().warning('no espeak-ng on this machine, so no speech: apt install it')

    def _on_setpoint(self, message: Setpoint) -> None:
        self._order(self._book.announce(self._shown(message), now=self._now()))

    def _shown(self, message: Setpoint) -> ShownSetpoint:
        """Return a setpoint as the book keeps it.

        Raises:
            InputError: its rates are not valid.
        """
        taken = conversions.time_from_msg(message.header.stamp)
        until = conversions.time_from_msg(message.valid_until)
        validity = until - taken
        age = believed_age(taken, self._now(), validity, simulated=self._simulated)
        return ShownSetpoint(
            sequence=message.sequence,
            rates=conversions.rates_from_msg(message.wells),
            stamp=taken,
            valid_until=until,
            validity=validity - age,
            reason=message.reason,
        )

    def _on_cycle(self, message: CycleReport) -> None:
        """Say what a person must know of a photograph, once until it is over."""
        found = {
            kind: one
            for kind in (NO_SETPOINT, BY_THE_PUMPS)
            for one in message.remarks
            if kind in one
        }
        for kind in found.keys() - self._told:
            self._words.tell(HUB, said(HUB, found[kind]))
            self._speak(in_short(found[kind]))
        self._told = frozenset(found)

    def _on_offer(self, message: MendOffer) -> None:
        """Say what a diagnosis offers to the model, and what became of it."""
        _, asks = conversions.offer_state_from_msg(message)
        text = f'offer {message.sequence}: {said(MEND, message.sentence)}'
        if asks:
            text += '\n  answer on the page, or with ./porotwin mend accept or refuse'
        self._words.tell(MEND, text)
        sentence = in_short(message.sentence)
        self._speak(f'{sentence} Accept?' if asks else sentence, about=('model',))

    def _on_start(self, began: float) -> None:
        self._book.began = began

    def _on_timer(self) -> None:
        self._words.look()
        self._refusals.look()
        words = self._book.expire(self._now())
        if words is not None:
            self._order(words)

    def _order(self, words: Announcement) -> None:
        """Print and speak rates of the book: only from here comes an order to set a pump."""
        _print(words.text)
        self._speak(words.speech, about=words.changed)

    def _speak(self, speech: str, *, about: Sequence[str] = ()) -> None:
        """Announce a sentence, and say it aloud if it is `about` something to set or to answer."""
        self._announcements.publish(String(data=speech))
        voice = self._voice
        if voice is not None and about:
            voice.say(speech, about)

    def _on_confirm(
        self, request: ConfirmRates.Request, response: ConfirmRates.Response
    ) -> ConfirmRates.Response:
        try:
            caller = self._page.check(request)
            changed = conversions.rates_from_msg(request.wells)
            rates = self._book.confirmed(request.sequence, changed)
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self._refusals.tell('', f'confirmation refused: {error}')
            return response
        # by the clock of the photographs, so that the hub can compare it with them
        now = conversions.time_to_msg(self._now() + self._book.ahead)
        message = WellRates(start=now, wells=conversions.rates_to_msg(rates))
        message.header.stamp = now
        message.header.frame_id = conversions.RIG_FRAME
        self._measured.publish(message)
        _print(confirmation_in_words(request.sequence, changed, caller.node))
        response.outcome = conversions.ok()
        return response

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        try:
            self._guard.check(request)
            self._book.check(self._shown(request.setpoint))
        except InputError as error:
            response.outcome = conversions.refusal(error)
            line = f'setpoint {request.setpoint.sequence} refused: {error}'
            self._refusals.tell('wells/setpoint', line)
            return response
        response.outcome = conversions.ok()
        return response

    def _on_ping(self, request: Ping.Request, response: Ping.Response) -> Ping.Response:
        response.name = 'operator'
        response.version = __version__
        response.status = 'a person at the pumps'
        response.time = self.get_clock().now().to_msg()
        return response


def _print(text: str) -> None:
    print(text, flush=True)


def main() -> None:
    """Run the node."""
    run(OperatorNode)


if __name__ == '__main__':
    main()
