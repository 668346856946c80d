"""A live experiment on the virtual rig: photograph, command, wait, photograph."""

from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.limits import refuse_broken_limits
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig


@dataclass(frozen=True)
class Command:
    """Rates that hold until `valid_until` [s]; afterwards the safe rates hold."""

    rates: dict[str, WellRate]
    valid_until: float


class AssetSession:
    """The virtual rig from photograph to photograph.

    The session begins with the safe rates. It checks each command against the limits of the rig. A
    command holds until it expires. The pumps of fixed wells make their announced pauses to the
    second, by their own programs; commands tell which rest at their time.

    Args:
        asset: the virtual rig.
        photographer: takes its photographs.
        photo_interval: time between photographs [s].
    """

    def __init__(
        self, asset: VirtualRig, photographer: Photographer, *, photo_interval: float
    ) -> None:
        self.asset = asset
        self._photographer = photographer
        self._interval = photo_interval
        self._safe = safe_rates(asset.rig)
        self._pauses = FixedPauses.of(asset.rig)
        self._command = Command(self._safe, 0.0)

    @property
    def time(self) -> float:
        """Time since the start of the experiment [s]."""
        return self.asset.time

    def baseline(self) -> bytes:
        """Return a photograph without tracer."""
        return self._photographer.baseline()

    def photograph(self) -> bytes:
        """Return a photograph of this moment."""
        fine = self.asset.rig.default_grid().refined(2)
        signal = signal_seen(self.asset, fine, time=self.time)
        return self._photographer.photograph(signal, time=self.time)

    def advance_with_safe_rates(self, until: float) -> None:
        """Pump the safe rates until the time `until` [s], before the twin starts."""
        self._pump(self._safe, until)

    def command(self, rates: WellRates, *, valid_until: float) -> None:
        """Command `rates` from now until `valid_until` [s].

        Raises:
            InputError: the rates break a limit of the rig, or have already expired.
        """
        refuse_broken_limits(self.asset.rig, rates)
        if valid_until < self.time:
            raise InputError(
                f'setpoint was valid until {valid_until:.3f} s, now it is {self.time:.3f} s; '
                'decide again'
            )
        self._command = Command(dict(rates), valid_until)

    def advance(self) -> dict[str, WellRate]:
        """Advance by one photo interval; return the mean metered rates.

        Raises:
            InputError: a well of the command is not known.
        """
        end = self.time + self._interval
        switch = min(max(self._command.valid_until, self.time), end)
        parts = self._pump(self._command.rates, switch) + self._pump(self._safe, end)
        return _mean([(span / self._interval, rates) for span, rates in parts])

    def _pump(self, rates: WellRates, until: float) -> list[tuple[float, dict[str, WellRate]]]:
        """Pump `rates` with the announced pauses; return spans [s] and the metered rates."""
        parts = []
        for moment in [*sorted(self._pauses.moments(self.time, until)), until]:
            span = moment - self.time
            if span > SAME_STAMP_S:
                self.asset.set_rates(self._pauses.at(self.time + span / 2.0, rates))
                self.asset.advance(span)
                parts.append((span, self.asset.measured_rates()))
        return parts


def _mean(shares: list[tuple[float, dict[str, WellRate]]]) -> dict[str, WellRate]:
    """Return the mean of rates weighted by `shares` of the time; concentrations by tracer."""
    wells = dict.fromkeys(name for _, rates in shares for name in rates)
    mean = {}
    for name in wells:
        parts = [(share, rates.get(name, WellRate())) for share, rates in shares]
        rate = sum(share * well.rate for share, well in parts)
        tracer = sum(share * well.rate * well.concentration for share, well in parts)
        mean[name] = WellRate(rate, min(max(tracer / rate, 0.0), 1.0) if rate > 0.0 else 0.0)
    return mean


def parse_speed(speed: str) -> float | None:
    """Return the speed relative to real time; None for as fast as possible.

    Raises:
        InputError: neither `max` nor a positive number.
    """
    if speed == 'max':
        return None
    try:
        pace = float(speed)
    except ValueError:
        pace = 0.0
    if not pace > 0.0:
        raise InputError(f"speed '{speed}': write max, or a positive number")
    return pace
