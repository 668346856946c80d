"""A dry run of the pumps: every command that would be sent, without a device."""

from collections.abc import Callable

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_pumps.bridge import PumpBridge
from porotwin_pumps.protocols.protocol_registry import PROTOCOLS
from porotwin_pumps.protocols.pump_protocol import PumpError
from porotwin_pumps.pump_file import PumpEntry, pump_openers, serial_line
from porotwin_pumps.serial_line import SerialLine, WholeFn

Tell = Callable[[str], None]


class DryLine(SerialLine):
    """A line without a device: it tells every question, and answers like faultless pumps."""

    def __init__(self, path: str, answer: Callable[[bytes], bytes], tell: Tell) -> None:
        """Answer by `answer` and tell both by `tell`."""
        self.path = path
        self._answer, self._tell = answer, tell

    def ask(self, question: bytes, *, end: bytes | WholeFn) -> bytes:  # noqa: ARG002
        """Return the answer to `question`."""
        answer = self._answer(question)
        self._tell(f'{self.path}  {shown(question)}  ->  {shown(answer)}')
        return answer

    def close(self) -> None:
        """Do nothing."""


def shown(text: bytes) -> str:
    """Return bytes of a line as a person reads them, such as 00RAT 500MH\\r."""
    return text.decode('latin-1').encode('unicode_escape').decode('ascii')


def dry_run(rig: Rig, pumps: dict[str, PumpEntry], rates: WellRates, tell: Tell) -> None:
    """Tell what is sent at the start, for the setpoint `rates` [m^3/s], and at the end.

    Raises:
        InputError: a protocol has no dry run, a well no pump, or a pump is too small.
    """

    def line_of(entry: PumpEntry) -> SerialLine:
        pretend = PROTOCOLS[entry.protocol].pretend
        if pretend is None:
            raise InputError(f'{entry.protocol}: has no dry run; its `pretend` is missing')
        return DryLine(serial_line(entry).path, pretend(lambda: 0.0), tell)

    tell('the program starts: safe rates')
    limits = {well: entry.max_rate_ml_h for well, entry in pumps.items()}
    bridge = PumpBridge(rig, pump_openers(pumps, line_of), max_rates_ml_h=limits, now=0.0)
    if bridge.faults:
        raise PumpError(str(bridge.faults))
    tell('a setpoint arrives')
    bridge.command(rates, until=1.0, now=0.0)
    tell('a look at the pumps, each second')
    bridge.tick(1.0)
    tell('the program ends: safe rates')
    bridge.go_safe(1.0)
