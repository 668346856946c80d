"""Pretended drives of the Masterflex L/S family; `protocols.masterflex` names the source."""

import re
from collections import defaultdict

from porotwin_pumps.pretended.motor import ClockFn, PretendedMotor

COMMAND = re.compile(r'\x02P(?P<number>\d\d)(?P<name>[A-Z]?0?)(?P<value>[+-][\d.]+)?\r')


class PretendedDrive(PretendedMotor):
    """One drive; a turn counts as a millilitre."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin at rest."""
        self.rpm = 0.0
        self.running = False
        super().__init__(clock)

    @property
    def running_ml_h(self) -> float:  # type: ignore[override]
        """Turns in an hour, negative when it turns counter-clockwise."""
        return 60.0 * self.rpm if self.running else 0.0

    def answer(self, name: str, value: str | None) -> str:
        """Return the answer to a command."""
        self.pump()
        if name == 'S' and value is None:
            return f'S{self.rpm:+06.1f}'
        if name == 'C':
            return f'C{self.infused_ml + self.withdrawn_ml:010.2f}'
        if name not in ('', 'S', 'G0', 'H') or abs(float(value or 0.0)) > 600.0:
            return ''
        if name == 'S':
            self.rpm = float(value or 0.0)
        elif name:
            self.running = name == 'G0'
        return '\x06'


class PretendedDrives:
    """Drives of any number on one line."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin with all drives at rest."""
        self.pumps = defaultdict[int, PretendedDrive](lambda: PretendedDrive(clock))

    def __call__(self, question: bytes) -> bytes:
        """Return the answer to a command; empty until it is whole."""
        if question == b'\x05':
            return b'\x02P?0\r'
        found = COMMAND.fullmatch(question.decode('ascii'))
        if found is None:
            return b''
        said = self.pumps[int(found['number'])].answer(found['name'], found['value'])
        data = f'\x02P{found["number"]}{said}\r'
        return (said if said == '\x06' else data if said else '\x15').encode('ascii')
