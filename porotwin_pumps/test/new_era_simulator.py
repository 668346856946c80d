"""Simulated pumps of the NE-1000 family on a pseudo-terminal, after the manual of the maker.

Source: New Era, publication 1200-01, section 10: commands, states, alarms and errors in basic mode.
"""

import os
import pty
import re
import select
import threading
import time
import tty
from collections.abc import Callable

COMMAND = re.compile(r'(?P<address>\d{0,2})(?P<name>[A-Z]{0,3})(?P<value>.*)')
ML_H = {'MH': 1.0, 'UH': 1e-3, 'MM': 60.0, 'UM': 60e-3}


class SimulatedPump:
    """One pump; its rate and direction, and faults that tests set.

    `fault` is '' or one of: silent, garbage, partial, other_address, deaf (does not run), alarm.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.state = 'S'
        self.direction = 'INF'
        self.rate_ml_h = 0.0
        self.unit = 'MH'
        self.diameter_mm = 10.0
        self.volume = 1.0
        self.alarm = 'R'
        self.fault = ''
        self.infused_ml = 0.0
        self.withdrawn_ml = 0.0
        self._seen = clock()
        self.commands: list[str] = []

    @property
    def running_ml_h(self) -> float:
        """Return its rate now [ml/h], negative when it withdraws."""
        return {'I': self.rate_ml_h, 'W': -self.rate_ml_h}.get(self.state, 0.0)

    def power_cycle(self) -> None:
        self._pump()
        self.state, self.alarm = 'S', 'R'

    def stall(self) -> None:
        self._pump()
        self.state, self.alarm = 'S', 'S'

    def answer(self, name: str, value: str) -> str:
        """Return status and data for a command."""
        self._pump()
        self.commands.append(name + value)
        if self.alarm:
            text, self.alarm = f'A?{self.alarm}', ''
            return text
        data = self._execute(name, value)
        return self.state + data

    def _pump(self) -> None:
        now = self._clock()
        volume_ml = self.running_ml_h * (now - self._seen) / 3600.0
        self.infused_ml += max(volume_ml, 0.0)
        self.withdrawn_ml += max(-volume_ml, 0.0)
        self._seen = now

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
            if running or self.fault == 'deaf':
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


class PumpLine:
    """Pumps with the addresses 0, 1, ... on one pseudo-terminal; `path` is its name."""

    def __init__(self, count: int) -> None:
        self.pumps = [SimulatedPump() for _ in range(count)]
        self._master, slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(slave)
        self._slave = slave
        self.path = os.ttyname(slave)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        buffer = b''
        while not self._ended.is_set():
            ready, _, _ = select.select([self._master], [], [], 0.05)
            if not ready:
                continue
            try:
                buffer += os.read(self._master, 256)
            except OSError:
                return
            while b'\r' in buffer:
                line, _, buffer = buffer.partition(b'\r')
                self._reply(line.decode('ascii').replace(' ', '').upper())

    def _reply(self, line: str) -> None:
        found = COMMAND.fullmatch(line)
        assert found is not None
        address = int(found['address'] or 0)
        if address >= len(self.pumps):
            return
        pump = self.pumps[address]
        if pump.fault == 'silent':
            return
        said = f'\x02{address:02d}{pump.answer(found["name"], found["value"])}\x03'
        if pump.fault == 'garbage':
            said = '\xff?!x\x03'
        elif pump.fault == 'partial':
            said = said[:3]
        elif pump.fault == 'other_address':
            said = said.replace(f'{address:02d}', '77', 1)
        os.write(self._master, said.encode('latin-1'))

    def unplug(self) -> None:
        """End the line, as when a cable is pulled."""
        self._ended.set()
        self._thread.join(5.0)
        os.close(self._master)
        os.close(self._slave)
