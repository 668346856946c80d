"""The expiry of setpoints: how long the rates of a setpoint may be pumped without a successor.

A setpoint carries the stamp of its photograph and is valid for a few photo intervals. Afterwards
the asset goes to its safe rates by itself, the twin assumes so, and the operator is told so.
"""

from dataclasses import dataclass

from porotwin_core.clock.photo_interval import VALIDITY_INTERVALS
from porotwin_core.rates.wells import WellRate


@dataclass(frozen=True)
class SetpointDecision:
    """Rates of every well [m^3/s], valid until `valid_until` [s], and their reason in words."""

    rates: dict[str, WellRate]
    valid_until: float
    reason: str


def validity(photo_interval: float) -> float:
    """Return the time [s] after its photograph during which a setpoint is valid."""
    return VALIDITY_INTERVALS * photo_interval


class ExpiryWatch:
    """Reports once when the newest setpoint expires without a successor."""

    def __init__(self) -> None:
        """Watch nothing yet."""
        self._sequence = 0
        self._deadline: float | None = None

    def start(self, sequence: int, *, now: float, validity: float) -> None:
        """Watch setpoint `sequence`, valid for `validity` [s] from `now` [s] on."""
        self._sequence = sequence
        self._deadline = now + validity

    def expired(self, now: float) -> int | None:
        """Return the number of the setpoint that has expired by `now` [s], else None.

        Each setpoint is returned once.
        """
        if self._deadline is None or now <= self._deadline:
            return None
        self._deadline = None
        return self._sequence
