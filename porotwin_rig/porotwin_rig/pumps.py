"""The pumps: commanded, metered and true rates of the wells."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_rig.effects import EffectSet


@dataclass(frozen=True)
class Pumps:
    """The delivery of the pumps.

    In the paper (sec. 4) the pump of the producer delivered about 1 % less than prescribed:
    `Pumps({'producer': 0.99})`.

    Args:
        delivery: factor between commanded and metered rate by well; 1 for wells not named.
    """

    delivery: Mapping[str, float] = field(default_factory=dict)

    def measured(self, commanded: WellRates) -> dict[str, WellRate]:
        """Return the metered rates for `commanded` ones."""
        return {
            name: WellRate(well.rate * self.delivery.get(name, 1.0), well.concentration)
            for name, well in commanded.items()
        }


class Tube:
    """A tube of `dead` [m^3] of water, known by the tracer [m^3] that entered with the water."""

    def __init__(self, dead: float) -> None:
        self._water, self._tracer = [0.0, dead], [0.0, 0.0]

    def leaving(self, volume: float, concentration: float) -> float:
        """Push `volume` [m^3] of this concentration in; return the mean of what leaves."""
        pumped = self._water[-1] - self._water[1]
        self._water.append(self._water[-1] + volume)
        self._tracer.append(self._tracer[-1] + volume * concentration)
        left = np.interp([pumped, pumped + volume], self._water, self._tracer)
        return float(min(max((left[1] - left[0]) / volume, 0.0), 1.0))


class RunningPumps:
    """The pumps of one rig while they run: from a setpoint to the true rates.

    Attributes:
        commanded: the rates that were set last.
        measured: the metered rates of the last interval.
    """

    def __init__(self, rig: Rig, pumps: Pumps, effects: EffectSet) -> None:
        self.pumps = pumps
        self.commanded: dict[str, WellRate] = {}
        self.measured: dict[str, WellRate] = {}
        self._wells = rig.wells
        self._effects = effects
        self._tubes: dict[str, Tube] = {}

    def command(self, rates: WellRates) -> None:
        """Set `rates`; wells that are not named stop.

        Raises:
            InputError: a well is not known.
        """
        for name in rates:
            if name not in self._wells:
                raise InputError(
                    f"rate for an unknown well '{name}'; known: {', '.join(self._wells)}"
                )
        self.commanded = dict(rates)

    def start(self) -> None:
        """Begin an interval: the flow meters show the rates for the present commands."""
        self.measured = self.pumps.measured(self.commanded)

    def true_rates(self, start: float, end: float) -> dict[str, WellRate]:
        """Return the mean true rates from `start` to `end` [s], without wells at rest.

        Each call pumps through the tubes, so that calls follow each other in time.
        """
        return {
            name: self._true_rate(name, rate, start, end)
            for name, rate in self.measured.items()
            if rate.rate != 0.0
        }

    def _true_rate(self, name: str, metered: WellRate, start: float, end: float) -> WellRate:
        rate = metered.rate * self._effects.rate_factor(name, start=start, end=end)
        stock = metered.concentration * self._effects.stock_factor(name, start=start, end=end)
        dead = self._effects.tube_ml(name) / ML
        if dead > 0.0 and rate > 0.0:
            tube = self._tubes.setdefault(name, Tube(dead))
            stock = tube.leaving(rate * (end - start), stock)
        return WellRate(rate, stock)


def balanced(rates: WellRates) -> dict[str, WellRate]:
    """Return balanced rates for a closed rig: sinks take out as much as is injected.

    Sand and water are incompressible. The pressure at the producers changes until the rates
    balance.
    """
    put_in = math.fsum(rate.rate for rate in rates.values() if rate.rate > 0.0)
    taken = -math.fsum(rate.rate for rate in rates.values() if rate.rate < 0.0)
    if put_in == 0.0 or taken == 0.0:
        return {name: WellRate(0.0, rate.concentration) for name, rate in rates.items()}
    return {
        name: rate if rate.rate >= 0.0 else WellRate(rate.rate * put_in / taken, rate.concentration)
        for name, rate in rates.items()
    }
