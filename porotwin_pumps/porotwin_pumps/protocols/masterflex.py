"""Peristaltic pumps on Masterflex L/S digital drives of Cole-Parmer with an RS-232 link.

Source: commands of the drives 07523-80, -90 and 07551 as open drivers send them; the manual was not
at hand, and no drive has answered yet. Drives have the numbers 1 to 89. A command is
`<STX>P<number><command><CR>`. The answer is <ACK>, <NAK>, or `<STX>P<number><data><CR>`. Some
drives answer G0 with <NAK> and run, so that the counter of turns must tell.
"""

import re
import time

from porotwin_core.basis.errors import InputError
from porotwin_pumps.pretended.masterflex_drives import PretendedDrives
from porotwin_pumps.protocols._counter import SignedCounter
from porotwin_pumps.protocols.pump_protocol import PumpError, PumpProtocol, PumpSilent
from porotwin_pumps.serial_line import LineError, SerialLine

ENQ, ACK, NAK, END = b'\x05', b'\x06', b'\x15', b'\r'
DATA = re.compile(rb'\x02P(?P<number>\d\d)(?P<name>[A-Z])(?P<value>[+-]?\d+\.?\d*)\r')


class MasterflexPump:
    """One drive; clockwise is into the rig."""

    def __init__(self, line: SerialLine, address: int, *, ml_per_turn: float) -> None:
        """Give the drive its number and stop it.

        Args:
            line: the serial line.
            address: number of the drive on the line, 1 to 89.
            ml_per_turn: volume of a turn with this tube [ml].

        Raises:
            InputError: the address or the tube is wrong.
            PumpError: the drive does not answer or refuses.
        """
        if not 1 <= address <= 89:
            raise InputError(f'address {address} of a Masterflex drive: give 1 to 89')
        if not 0.0 < ml_per_turn <= 100.0:
            raise InputError(f'ml_per_turn {ml_per_turn:g} of a tube: give more than 0, up to 100')
        self._line, self._address, self._ml = line, address, ml_per_turn
        self._direction, self._rpm = 0, 0.0
        self._moved = (0.0, 0.0)
        """The last count of turns, and since when it stands [s]."""
        self._ask_line(ENQ)  # a drive that was switched on waits for its number
        self._tell('')
        self._tell('H')
        self._counter = SignedCounter(self._turns, ml_per_turn)

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h`; see `Pump.set_rate`."""
        self._tell('H')
        self._counter.volume_ml(self._direction)
        self._rpm = round(rate_ml_h / 60.0 / self._ml, 1)
        self._direction = (self._rpm > 0.0) - (self._rpm < 0.0)
        if rate_ml_h and abs(60.0 * self._rpm * self._ml - rate_ml_h) > 0.05 * abs(rate_ml_h):
            raise PumpError(f'{rate_ml_h:g} ml/h is no speed that it can keep; take another tube')
        if self._direction:
            self._tell(f'S{self._rpm:+06.1f}')
            self._ask('G0')
            self._moved = (self._turns(), time.monotonic())
        self.check()

    def check(self) -> None:
        """Check that the drive turns as it was set; see `Pump.check`."""
        if not self._direction:
            return
        if (told := self._value('S')) != self._rpm:
            raise PumpError(f'set to {self._rpm:g} rpm, it says {told:g} rpm')
        turns, now = self._turns(), time.monotonic()
        last, since = self._moved
        if turns != last:
            self._moved = (turns, now)
        elif (now - since) * abs(self._rpm) / 60.0 > 0.1:  # it counts hundredths of a turn
            raise PumpError('it does not turn, against its command')

    def volume_ml(self) -> float:
        """Return the volume since the start; see `Pump.volume_ml`."""
        return self._counter.volume_ml(self._direction)

    def _turns(self) -> float:
        return self._value('C')

    def _value(self, command: str) -> float:
        answer = self._ask(command)
        found = DATA.fullmatch(answer)
        if not found or int(found['number']) != self._address or found['name'] != command.encode():
            raise PumpError(f'it answers {answer!r} when asked {command}, which makes no sense')
        return float(found['value'])

    def _tell(self, command: str) -> None:
        if (answer := self._ask(command)) != ACK:
            said = 'it refuses' if answer == NAK else f'it answers {answer!r} to'
            raise PumpError(f"{said} '{command}'")

    def _ask(self, command: str) -> bytes:
        return self._ask_line(f'\x02P{self._address:02d}{command}\r'.encode('ascii'))

    def _ask_line(self, question: bytes) -> bytes:
        try:
            return self._line.ask(question, end=ACK + NAK + END)
        except LineError as error:
            if question == ENQ:
                return b''  # a drive that has its number does not answer
            raise PumpSilent(str(error)) from None


PROTOCOL = PumpProtocol(
    name='masterflex',
    open=MasterflexPump,
    baud=4800,
    frame='7O1',
    options={'ml_per_turn': 'volume of a turn with this tube [ml]'},
    pretend=PretendedDrives,
)
