"""Pretended pumps of the NE-1000 family, after the manual of the maker.

Source: New Era, publication 1200-01, section 10: commands, states, alarms and errors in basic mode.
"""

import re
from collections import defaultdict

from porotwin_pumps.pretended.motor import ClockFn, PretendedMotor

COMMAND = re.compile(r'(?P<address>\d{0,2})(?P<name>[A-Z]{0,3})(?P<value>.*)')
ML_H = {'MH': 1.0, 'UH': 1e-3, 'MM': 60.0, 'UM': 60e-3}


class PretendedPump(PretendedMotor):
    """One pump; `deaf` lets it not run, `alarm` is a letter that its next answer tells."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin at rest."""
        self.state = 'S'
        self.direction = 'INF'
        self.rate_ml_h = 0.0
        self.unit = 'MH'
        self.diameter_mm = 10.0
        self.volume = 1.0
        self.alarm = ''
        self.deaf = False
        self.commands: list[str] = []
        super().__init__(clock)

    @property
    def running_ml_h(self) -> float:  # type: ignore[override]
        """Its rate now [ml/h], negative when it withdraws."""
        return {'I': self.rate_ml_h, 'W': -self.rate_ml_h}.get(self.state, 0.0)

    def stop_with(self, alarm: str) -> None:
        """Stop, as after a power cut (R) or at a stall (S)."""
        self.pump()
        self.state, self.alarm = 'S', alarm

    def answer(self, name: str, value: str) -> str:
        """Return status and data for a command."""
        self.pump()
        self.commands.append(name + value)
        if self.alarm:
            text, self.alarm = f'A?{self.alarm}', ''
            return text
        data = self._execute(name, value)
        return self.state + data

    def _execute(self, name: str, value: str) -> str:
        running = self.state in 'IW'
        if name == '':
            return ''
        if name == 'STP':
            if self.state == 'S':
                return '?NA'
            self.state = 'P' if running else 'S'
            return ''
        if name == 'RUN':
            if running or self.deaf:
                return '?NA' if running else ''
            self.state = 'I' if self.direction == 'INF' else 'W'
            return ''
        if name == 'DIS':
            return f'I{self.infused_ml:.3f}W{self.withdrawn_ml:.3f}ML'
        if name in ('DIR', 'DIA', 'RAT', 'VOL'):
            return self._setting(name, value, running)
        return '?'

    def _setting(self, name: str, value: str, running: bool) -> str:
        if name == 'RAT' and not value:
            return f'{self._four_digits(self.rate_ml_h / ML_H[self.unit])}{self.unit}'
        if running:
            return '?NA'
        if name == 'DIR':
            if value not in ('INF', 'WDR'):
                return '?OOR'
            self.direction = value
            return ''
        number = re.fullmatch(r'(?P<number>[\d.]{1,5})(?P<unit>[UM][MH])?', value)
        if number is None:
            return '?'
        size = float(number['number'])
        if name == 'DIA':
            self.diameter_mm = size
        elif name == 'VOL':
            self.volume = size
        else:
            self.unit = number['unit'] or self.unit
            if size * ML_H[self.unit] > 2000.0:
                return '?OOR'
            self.rate_ml_h = size * ML_H[self.unit]
        return ''

    @staticmethod
    def _four_digits(value: float) -> str:
        return next(text for text in (f'{value:.{n}f}' for n in (3, 2, 1, 0)) if len(text) <= 5)


class PretendedPumps:
    """Pumps of any address on one line."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin with all pumps at rest."""
        self.pumps = defaultdict[int, PretendedPump](lambda: PretendedPump(clock))

    def __call__(self, question: bytes) -> bytes:
        """Return the answer to a command; empty until it is whole."""
        found = COMMAND.fullmatch(question.decode('ascii').replace(' ', '').upper().strip())
        if found is None or not question.endswith(b'\r'):
            return b''
        address = int(found['address'] or 0)
        said = self.pumps[address].answer(found['name'], found['value'])
        return f'\x02{address:02d}{said}\x03'.encode('ascii')
