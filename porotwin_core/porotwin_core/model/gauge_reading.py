"""Readings of a balance, of a manometer or of the outflow, beside the maps."""

from dataclasses import dataclass
from enum import StrEnum

from porotwin_core.basis.units import ML


class GaugeKind(StrEnum):
    """The kinds of readings. Each value is the word in `observations.csv`, with its unit."""

    OUTFLOW = 'outflow_ml'
    """Water that has left through a well, a side or other water; negative if it came in."""
    PRESSURE = 'pressure_pa'
    """Excess pressure over resting water at a port, against another port or the water."""
    CONCENTRATION = 'concentration'
    """Concentration of the water that leaves through a well, a side or other water."""

    @property
    def per_si(self) -> float:
        """Factor from SI to the unit in the word of the kind."""
        return ML if self is GaugeKind.OUTFLOW else 1.0


Port = tuple[float, float]
"""Where a pressure is read: (x, z) [m] from the lower left corner of the sand."""


@dataclass(frozen=True)
class GaugeReading:
    """One reading.

    Attributes:
        time: seconds from the start of the experiment [s].
        kind: the kind of the reading.
        value: the reading [m^3], [Pa] or [-].
        deviation: its standard deviation, above 0, in the unit of the value.
        place: name of the well, of the side or of the water, for an outflow or a concentration.
        port: where a pressure is read; None for other kinds.
        against: the second port of a pressure; None for the lowest open water.
    """

    time: float
    kind: GaugeKind
    value: float
    deviation: float
    place: str = ''
    port: Port | None = None
    against: Port | None = None

    @property
    def where(self) -> str:
        """The place in words, for tables."""
        if self.port is None:
            return self.place
        here = f'x {self.port[0]:.4g} m, z {self.port[1]:.4g} m'
        if self.against is None:
            return here
        return f'{here} against x {self.against[0]:.4g} m, z {self.against[1]:.4g} m'
