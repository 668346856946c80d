"""Syringe pumps of New Era Pump Systems: the NE-1000 family, also sold as Aladdin by WPI.

Source: New Era, user manual of the NE-1000, publication 1200-01, section 10 (RS-232, basic mode).
A command is `<address><command><CR>`. The answer is `<STX><address><status>[<data>]<ETX>`, with a
letter for the state or `A?` and a letter for an alarm; data that begin with `?` are an error.
"""

import math
import re

from porotwin_pumps.pretended.new_era_pumps import PretendedPumps
from porotwin_pumps.protocols.pump_protocol import (
    ROUND_OFF,
    PumpError,
    PumpProtocol,
    PumpSilent,
    check_syringe,
)
from porotwin_pumps.serial_line import LineError, SerialLine

STX, ETX = b'\x02', b'\x03'

ANSWER = re.compile(rb'\x02(?P<address>\d\d)(?P<status>A\?[A-Z]|[IWSPTUX])(?P<data>[^\x03]*)\x03')
NUMBER = r'(?:\d+\.?\d*|\.\d+)'
RATE = re.compile(rf'(?P<value>{NUMBER})(?P<unit>[UM][MH])')
VOLUMES = re.compile(rf'I(?P<infused>{NUMBER})W(?P<withdrawn>{NUMBER})(?P<unit>UL|ML)')

ALARMS = {
    'R': 'it was reset; its power was interrupted',
    'S': 'its motor stalled',
    'T': 'it waited too long for a command',
    'E': 'its pumping program is wrong',
    'O': 'its pumping program is out of range',
}
ERRORS = {
    '?': 'it does not know this command',
    '?NA': 'not possible in its present state',
    '?OOR': 'the value is out of its range',
    '?COM': 'the packet was damaged',
    '?IGN': 'it was busy',
}
ML_H_IN = {'MH': 1.0, 'UH': 1e-3, 'MM': 60.0, 'UM': 60e-3}
"""Units of rates in ml/h: millilitres or microlitres, per hour or minute."""

GREATEST_ML_H = 9999.0
"""Greatest rate that four digits can say [ml/h]."""

STEP_ML_H = 0.001
"""Smallest rate that the pump accepts [ml/h]."""

RUNNING = {1: 'I', -1: 'W', 0: 'SP'}
"""States of a pump that infuses, withdraws or rests."""


class NewEraPump:
    """One pump of the NE-1000 family; infusing is into the rig."""

    def __init__(self, line: SerialLine, address: int, *, diameter_mm: float) -> None:
        """Find the pump, stop it, and set its syringe.

        Args:
            line: the serial line.
            address: of the pump on the line, 0 to 99.
            diameter_mm: inner diameter of the syringe [mm].

        Raises:
            InputError: the address or the diameter is wrong.
            PumpError: the pump does not answer or refuses.
        """
        check_syringe(address, diameter_mm)
        self._line = line
        self._address = address
        self._direction = 0
        try:
            self._ask('')
        except PumpError:
            # the first answer after power-on is the alarm that there was no power
            self._ask('')
        self._halt()
        self._ask(f'DIA {_number(diameter_mm)}')

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h`; see `Pump.set_rate`."""
        size = abs(rate_ml_h)
        if not size <= GREATEST_ML_H:
            raise PumpError(f'{rate_ml_h:g} ml/h is more than the pump accepts')
        self._halt()
        self._direction = 0 if size < STEP_ML_H else int(math.copysign(1, rate_ml_h))
        if self._direction == 0:
            return
        self._ask(f'DIR {"INF" if self._direction > 0 else "WDR"}')
        self._ask(f'RAT {_number(size)}MH')
        self._ask('VOL 0')  # no volume to reach: until told otherwise
        self._ask('RUN')
        self.check()
        told = self._rate_ml_h()
        if abs(told - size) > ROUND_OFF * size + STEP_ML_H:
            raise PumpError(f'commanded {size:g} ml/h, it runs at {told:g} ml/h')

    def check(self) -> None:
        """Check that the pump runs as it was set; see `Pump.check`."""
        state, _ = self._ask('')
        if state not in RUNNING[self._direction]:
            said = {'I': 'infuses', 'W': 'withdraws'}.get(state, 'has stopped')
            raise PumpError(f'it {said}, against its command')

    def volume_ml(self) -> float:
        """Return the volume since the rate was set; see `Pump.volume_ml`."""
        _, data = self._ask('DIS')
        found = VOLUMES.fullmatch(data)
        if found is None:
            raise PumpError(f'it answers {data!r} when asked for its volume')
        litres = float(found['infused']) - float(found['withdrawn'])
        return litres * (1e-3 if found['unit'] == 'UL' else 1.0)

    def _rate_ml_h(self) -> float:
        _, data = self._ask('RAT')
        found = RATE.fullmatch(data)
        if found is None:
            raise PumpError(f'it answers {data!r} when asked for its rate')
        return float(found['value']) * ML_H_IN[found['unit']]

    def _halt(self) -> None:
        """Stop the pump: a running program is paused first, then ended."""
        state, _ = self._ask('')
        while state != 'S':
            before = state
            state, _ = self._ask('STP')
            if state == before:
                raise PumpError('it does not stop')

    def _ask(self, command: str) -> tuple[str, str]:
        """Return the state and the data of the answer to `command`.

        Raises:
            PumpError: no answer, an answer that makes no sense, an alarm, or an error.
        """
        question = f'{self._address:02d}{command}\r'.encode('ascii')
        try:
            answer = self._line.ask(question, end=ETX)
        except LineError as error:
            raise PumpSilent(str(error)) from None
        found = ANSWER.fullmatch(answer[answer.rfind(STX) :] if STX in answer else answer)
        if found is None or int(found['address']) != self._address:
            raise PumpError(f'it answers {answer!r}, which makes no sense')
        status = found['status'].decode()
        data = found['data'].decode('ascii', errors='replace').strip()
        if status.startswith('A?'):
            raise PumpError(f'alarm: {ALARMS.get(status[2], status)}')
        if data.startswith('?'):
            raise PumpError(f"it refuses '{command}': {ERRORS.get(data, data)}")
        return status, data


def _number(value: float) -> str:
    """Return a number as the pump reads it: four digits, at most three of them decimals."""
    for decimals in (3, 2, 1):
        text = f'{value:.{decimals}f}'
        if len(text) <= 5:
            return text
    return f'{value:.0f}'


PROTOCOL = PumpProtocol(
    name='new_era',
    open=NewEraPump,
    baud=19200,
    options={'diameter_mm': 'inner diameter of the syringe [mm]'},
    pretend=PretendedPumps,
)
