"""Pretended pumps of Harvard Apparatus and KD Scientific; `protocols.harvard` names the source."""

import re
from collections import defaultdict

from porotwin_pumps.pretended.motor import ClockFn, PretendedMotor

COMMAND = re.compile(r'(?P<address>\d{0,2})(?P<name>[a-z ]*?)(?P<value>[\d.]+)?( ml/min)?\r')


class PretendedHarvardPump(PretendedMotor):
    """One pump; its prompt is : at rest, > or < when it runs, * when it stalled."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin at rest."""
        self.prompt = ':'
        self.rates = {'irate': 0.0, 'wrate': 0.0}
        self.diameter_mm = 10.0
        super().__init__(clock)

    @property
    def running_ml_h(self) -> float:  # type: ignore[override]
        """Its rate now [ml/h], negative when it withdraws."""
        sign = {'>': 1.0, '<': -1.0}.get(self.prompt, 0.0)
        return sign * 60.0 * self.rates['irate' if sign > 0.0 else 'wrate']

    def answer(self, name: str, value: str | None) -> str:
        """Return the line that answers a command; empty if there is none."""
        self.pump()
        if name in ('', 'poll on', 'ctvolume'):
            return ''
        if name in ('irun', 'wrun', 'stop'):
            self.prompt = {'irun': '>', 'wrun': '<', 'stop': ':'}[name]
            return ''
        if name in ('ivolume', 'wvolume'):
            return f'{self.infused_ml if name[0] == "i" else self.withdrawn_ml:.4f} ml'
        if name == 'diameter' and value:
            self.diameter_mm = float(value)
            return ''
        if name not in self.rates:
            return 'Unknown command'
        if value is None:
            return f'{self.rates[name]:.5g} ml/min'
        if not 0.0 < float(value) <= 40.0:
            return 'Argument error: Out of range'
        self.rates[name] = float(value)
        return ''


class PretendedHarvardPumps:
    """Pumps of any address on one line."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin with all pumps at rest."""
        self.pumps = defaultdict[int, PretendedHarvardPump](lambda: PretendedHarvardPump(clock))

    def __call__(self, question: bytes) -> bytes:
        """Return the answer to a command; empty until it is whole."""
        found = COMMAND.fullmatch(question.decode('ascii'))
        if found is None:
            return b''
        address = int(found['address'] or 0)
        pump = self.pumps[address]
        line = pump.answer(found['name'].strip(), found['value'])
        body = f'{address:02d}:{line}\r\n' if line else ''
        return f'\n{body}{address:02d}{pump.prompt}\x11'.encode('ascii')
