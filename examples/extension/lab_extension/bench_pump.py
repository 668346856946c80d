"""A pump of our bench: `R500` sets 500 ml/h, `R?` and `V?` ask for rate and volume."""

from porotwin_pumps.protocols.pump_protocol import PumpError, PumpProtocol, PumpSilent
from porotwin_pumps.serial_line import LineError, SerialLine


class BenchPump:
    """One pump on a line of its own."""

    def __init__(self, line: SerialLine, _address: int) -> None:
        """Stop the pump."""
        self._line = line
        self._told = 0.0
        self.set_rate(0.0)

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h`; see `Pump.set_rate`."""
        self._told = rate_ml_h
        self._ask(f'R{rate_ml_h:.1f}')
        self.check()

    def check(self) -> None:
        """Check that the pump runs as it was set; see `Pump.check`."""
        if abs(self._ask('R?') - self._told) > 0.1:
            raise PumpError('it runs at another rate')

    def volume_ml(self) -> float:
        """Return the volume since the start; see `Pump.volume_ml`."""
        return self._ask('V?')

    def _ask(self, command: str) -> float:
        try:
            return float(self._line.ask(f'{command}\r'.encode(), end=b'\r'))
        except LineError as error:
            raise PumpSilent(str(error)) from None
        except ValueError as error:
            raise PumpError(f'its answer makes no sense: {error}') from None


PROTOCOL = PumpProtocol(name='bench_pump', open=BenchPump, baud=9600, options={})
