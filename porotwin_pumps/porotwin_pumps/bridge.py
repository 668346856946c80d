"""The bridge between setpoints and pumps: it sets, watches and measures them.

The bridge sets the safe rates by itself when a setpoint expires without a successor, when a pump
fails, and at the end. It uses neither ROS nor a protocol directly.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_pumps.protocols.pump_protocol import Pump, PumpError, PumpSilent

RETRY_PERIOD_S = 5.0
"""Time between two attempts to reach a pump that failed [s]."""

SHORTEST_MEASUREMENT_S = 1.0
"""Shortest time over which a rate is measured [s]: volumes have steps of a microlitre."""

OpenPumpFn = Callable[[], Pump]
"""Opens a pump; raises PumpError if it does not answer."""


@dataclass
class _Channel:
    """The pump of one well: opened when it is needed, and again after a fault."""

    open: OpenPumpFn
    pump: Pump | None = None
    told_ml_h: float = 0.0
    fault: str = ''
    goes_on: bool = False
    """Whether a pump with a fault is believed to run as it was set last."""
    base_ml: float = field(default=0.0)
    """Volume at the beginning of the measurement."""

    def set_rate(self, rate_ml_h: float) -> None:
        """Set the pump, unless it already has this rate."""
        if self.pump is not None and rate_ml_h == self.told_ml_h:
            return
        try:
            self.pump = self.pump or self.open()
            self.pump.set_rate(rate_ml_h)
            self.base_ml = self.pump.volume_ml()
        except Exception as error:
            self.fail(error)
        else:
            self.told_ml_h, self.fault = rate_ml_h, ''

    def fail(self, error: Exception) -> None:
        """Note a fault: of the pump, or a mistake in its protocol, which may be anybody's."""
        mistake = '' if isinstance(error, PumpError) else f'{type(error).__name__}: '
        self.pump, self.fault = None, ' '.join(f'{mistake}{error}'.split())
        self.goes_on = isinstance(error, PumpSilent) or bool(mistake)

    def check(self) -> None:
        """Note a fault if the pump does not run at its commanded rate."""
        try:
            if self.pump is not None:
                self.pump.check()
        except Exception as error:
            self.fail(error)

    def begin_measurement(self) -> None:
        """Measure from now on."""
        self.mean_rate_ml_h(1.0)

    def mean_rate_ml_h(self, seconds: float) -> float:
        """Return the mean rate [ml/h] in the `seconds` since the last call or setting.

        Without a volume it is the rate that the pump is believed to have.
        """
        try:
            if self.pump is not None:
                volume = self.pump.volume_ml()
                pumped, self.base_ml = volume - self.base_ml, volume
                return pumped * 3600.0 / seconds
        except Exception as error:
            self.fail(error)
        return self.told_ml_h if self.goes_on else 0.0


@dataclass(frozen=True)
class Measurement:
    """Mean rates [m^3/s] over the last `duration` [s]."""

    duration: float
    rates: dict[str, WellRate]


class PumpBridge:
    """All pumps of a rig. Times [s] are on a clock that nobody sets."""

    def __init__(
        self,
        rig: Rig,
        openers: Mapping[str, OpenPumpFn],
        *,
        max_rates_ml_h: Mapping[str, float],
        now: float,
    ) -> None:
        """Reach all pumps and set the safe rates.

        Args:
            rig: the rig, with a control section.
            openers: opens the pump of a well, by well.
            max_rates_ml_h: greatest rate of every pump [ml/h].
            now: the time.
        """
        self._producer = rig.control.producer if rig.control else None
        self._safe = {well: safe_rates(rig)[well] for well in openers}
        self._limits_ml_h = dict(max_rates_ml_h)
        self._channels = {well: _Channel(open_pump) for well, open_pump in openers.items()}
        self._pauses = FixedPauses.of(rig)
        self.elapsed = 0.0
        """Time since the start of the experiment [s], for the announced pauses; 0 before it."""
        self._resting = self._pauses.resting(self.elapsed)
        self._wanted: dict[str, WellRate] = {}
        """The rates that were set last, without pauses."""
        self._rates: dict[str, WellRate] = {}
        """The rates that the pumps took last, with the fluid that a silent pump goes on with."""
        self._until: float | None = None
        self._since = now
        self._tried = now
        self._whole = True
        """Whether no pump failed, and none was set, since the measurement began."""
        self._answered: set[str] = set()
        """Wells of failed pumps because of which the others run at the safe rates."""
        self._go_safe()

    @property
    def faults(self) -> dict[str, str]:
        """The pumps that do not work, by well, each with one line."""
        return {well: item.fault for well, item in self._channels.items() if item.fault}

    def command(self, rates: WellRates, *, until: float, now: float) -> None:
        """Set `rates` [m^3/s], which hold until the time `until` [s].

        Raises:
            InputError: a well has no pump, or its pump is too small; nothing has changed.
            PumpError: a pump does not work; the others are at safe rates.
        """
        for well, rate in rates.items():
            if well not in self._channels and rate.rate != 0.0:
                raise InputError(f"well '{well}' has no pump; see the file of the pumps")
            if well in self._channels and not (
                abs(to_ml_h(rate.rate)) <= self._limits_ml_h[well] * (1.0 + 1e-9)
            ):
                raise InputError(
                    f"well '{well}': {to_ml_h(rate.rate):g} ml/h; "
                    f'its pump runs at up to {self._limits_ml_h[well]:g} ml/h'
                )
        wanted = {well: rates.get(well, WellRate()) for well in self._channels}
        changed = self._try_failed()
        if not self.faults:
            self._until = until
            self._apply({**wanted, **self._pauses.all_running(wanted)})
            self._begin_measurement(now)
        if self.faults:
            if not self._answer_faults() and changed:
                self._go_safe()
            raise PumpError(self._fault_line())

    def tick(self, now: float) -> str | None:
        """Check the pumps and the expiry of the setpoint; return a line on any event."""
        if self._until is not None and now > self._until:
            self._until = None
            self._go_safe()
            return 'the setpoint has ended and none followed; the pumps run at the safe rates'
        if (resting := self._pauses.resting(self.elapsed)) != self._resting:
            self._resting, self._whole = resting, False
            self._apply(self._wanted)
            return f'announced pauses: {", ".join(sorted(resting)) or "no well"} rests'
        for item in self._channels.values():
            item.check()
        if self._answer_faults():
            return self._fault_line()
        if self.faults and now - self._tried >= RETRY_PERIOD_S:
            self._tried = now
            if self._try_failed():
                self._go_safe()
                return self._fault_line() or 'all pumps work again, at the safe rates'
        return None

    def measure(self, now: float) -> Measurement | None:
        """Return the mean rates since the last call or setting.

        A pump that does not answer counts with the rate that was set last, one that has stopped
        counts with none. None if the time is too short, or if a pump failed or was set meanwhile.
        """
        duration = now - self._since
        if duration < SHORTEST_MEASUREMENT_S:
            return None
        failed = set(self.faults)
        ml_h = {well: item.mean_rate_ml_h(duration) for well, item in self._channels.items()}
        whole, self._since = self._whole and set(self.faults) == failed, now
        self._whole = True
        if not whole:
            return None
        concentrations = {
            well: self._rates[well].concentration if rate > 0.0 else 0.0
            for well, rate in ml_h.items()
        }
        return Measurement(
            duration,
            {well: WellRate(from_ml_h(rate), concentrations[well]) for well, rate in ml_h.items()},
        )

    def go_safe(self, now: float) -> None:
        """Set the safe rates, for the end of the program."""
        self._until = None
        self._go_safe()
        self._begin_measurement(now)

    def _begin_measurement(self, now: float) -> None:
        self._since, self._whole = now, True
        for item in self._channels.values():
            item.begin_measurement()

    def _answer_faults(self) -> bool:
        """Set the safe rates if a pump failed since they were set; return whether one did.

        Whoever talks to a pump may find its fault first: a look, a setpoint or a measurement.
        """
        if not set(self.faults) - self._answered:
            return False
        self._until = None
        self._go_safe()
        self._answered = set(self.faults)
        return True

    def _try_failed(self) -> bool:
        """Try the failed pumps again, at their safe rates; return whether one works again.

        No setpoint reaches them before all pumps work.
        """
        failed = set(self.faults)
        self._apply({well: self._safe[well] for well in failed})
        return set(self.faults) != failed

    def _fault_line(self) -> str:
        if not self.faults:
            return ''
        lines = [f"the pump of '{well}': {fault}" for well, fault in self.faults.items()]
        return f'{"; ".join(lines)}; the other pumps run at the safe rates'

    def _go_safe(self) -> None:
        """Set the safe rates; without a producer nothing is put in."""
        self._wanted |= self._safe  # the producer, which is set first, balances all of them
        safe = dict(self._safe)
        producer = {name: safe.pop(name) for name in [self._producer] if name in safe}
        self._apply(producer)
        if self._producer in self.faults:
            safe = {well: WellRate(min(rate.rate, 0.0)) for well, rate in safe.items()}
        self._apply(safe)
        self._whole = False

    def _apply(self, rates: Mapping[str, WellRate]) -> None:
        """Set pumps: first those that take water out, then those that put it in.

        The wells rest that have an announced pause, which setpoints do not know.
        """
        self._wanted |= rates
        rested = self._pauses.rested(self.elapsed, self._wanted)
        held = {well: rested[well] for well in rates}
        for well in sorted(held, key=lambda name: held[name].rate):
            self._channels[well].set_rate(to_ml_h(held[well].rate))
        faults = self.faults
        self._rates |= {well: rate for well, rate in held.items() if well not in faults}
        self._answered &= set(faults)
