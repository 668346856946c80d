"""Syringe pumps of Harvard Apparatus (11 Elite, PHD Ultra) and KD Scientific (Legato).

Source: commands of the mode *Quick Start* as open drivers send them; the manual was not at hand,
and no pump has answered yet. A command is `<address><command><CR>`. Lines of the answer end with a
line feed, and the last one is a prompt: the address and : at rest, > infusing, < withdrawing, *
stalled, T* target reached. In poll mode XON follows it.
"""

import re

from porotwin_pumps.pretended.harvard_pumps import PretendedHarvardPumps
from porotwin_pumps.protocols.pump_protocol import (
    ROUND_OFF,
    PumpError,
    PumpProtocol,
    PumpSilent,
    check_syringe,
)
from porotwin_pumps.serial_line import LineError, SerialLine

XON = b'\x11'
LINE = re.compile(r'(?P<address>\d\d)?(?P<prompt>T?\*|[:<>])?(?P<text>.*)')
RATE = re.compile(r'(?P<value>\d+\.?\d*) ?(?P<volume>[munp]l)/(?P<time>s|sec|min|h|hr)')
VOLUME = re.compile(r'(?P<value>\d+\.?\d*) ?(?P<volume>[munp]l)')
ML = {'ml': 1.0, 'ul': 1e-3, 'nl': 1e-6, 'pl': 1e-9}
PER_HOUR = {'s': 3600.0, 'sec': 3600.0, 'min': 60.0, 'h': 1.0, 'hr': 1.0}

PROMPTS = {1: '>', -1: '<', 0: ':'}
"""Prompts of a pump that infuses, withdraws or rests."""

STOPPED = {'*': 'its motor stalled', 'T*': 'it has reached a target volume; clear it at the pump'}


class HarvardPump:
    """One pump; infusing is into the rig."""

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
        self._line, self._address, self._direction = line, address, 0
        self._ask('poll on')
        self._ask('stop')
        self._ask('ctvolume')  # no volume to reach: until told otherwise
        self._ask(f'diameter {diameter_mm:.4f}')

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h`; see `Pump.set_rate`."""
        self._ask('stop')
        self._direction = (rate_ml_h > 0.0) - (rate_ml_h < 0.0)
        if self._direction == 0:
            return self.check()
        letter = 'i' if self._direction > 0 else 'w'
        self._ask(f'{letter}rate {abs(rate_ml_h) / 60.0:.6f} ml/min')
        self._ask(f'{letter}run')
        self.check()
        found = RATE.fullmatch(text := self._ask(f'{letter}rate')[1])
        if found is None:
            raise PumpError(f'it answers {text!r} when asked for its rate')
        told = float(found['value']) * ML[found['volume']] * PER_HOUR[found['time']]
        if abs(told - abs(rate_ml_h)) > ROUND_OFF * abs(rate_ml_h):
            raise PumpError(f'commanded {abs(rate_ml_h):g} ml/h, it runs at {told:g} ml/h')
        return None

    def check(self) -> None:
        """Check that the pump runs as it was set; see `Pump.check`."""
        prompt, _ = self._ask('')
        if prompt != PROMPTS[self._direction]:
            said = {'>': 'infuses', '<': 'withdraws'}.get(prompt, 'has stopped')
            raise PumpError(f'it {said}, against its command')

    def volume_ml(self) -> float:
        """Return the volume since the start; see `Pump.volume_ml`."""
        return self._volume_ml('ivolume') - self._volume_ml('wvolume')

    def _volume_ml(self, command: str) -> float:
        found = VOLUME.fullmatch(text := self._ask(command)[1])
        if found is None:
            raise PumpError(f'it answers {text!r} when asked for its volume')
        return float(found['value']) * ML[found['volume']]

    def _ask(self, command: str) -> tuple[str, str]:
        """Return the prompt and the line of the answer to `command`.

        Raises:
            PumpError: no answer, an answer that makes no sense, a stall, or an error.
        """
        question = f'{self._address:02d}{command}\r'.encode('ascii')
        try:
            answer = self._line.ask(question, end=XON)
        except LineError as error:
            raise PumpSilent(str(error)) from None
        *said, last = answer.rstrip(XON).decode('latin-1').strip().splitlines() or ['']
        prompt, parts = LINE.fullmatch(last), [LINE.fullmatch(one) for one in said if one]
        lines = [one for one in parts if one is not None]
        addresses = {int(one['address'] or 0) for one in [prompt, *lines] if one}
        if prompt is None or not prompt['prompt'] or prompt['text'] or addresses != {self._address}:
            raise PumpError(f'it answers {answer!r}, which makes no sense')
        text = ' '.join(one['text'].strip() for one in lines)
        if prompt['prompt'] in STOPPED and command != 'stop':
            raise PumpError(STOPPED[prompt['prompt']])
        if re.search('error|unknown|out of range', text, re.IGNORECASE):
            raise PumpError(f"it refuses '{command}': {text}")
        return prompt['prompt'], text


PROTOCOL = PumpProtocol(
    name='harvard',
    open=HarvardPump,
    baud=115200,
    options={'diameter_mm': 'inner diameter of the syringe [mm]'},
    pretend=PretendedHarvardPumps,
)
