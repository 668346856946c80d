"""Volumes of pumps whose counter knows no direction."""

from collections.abc import Callable

from porotwin_pumps.protocols.pump_protocol import PumpError


class SignedCounter:
    """Adds the counts of a counter, with the direction of the pump meanwhile."""

    def __init__(self, read: Callable[[], float], ml_per_count: float) -> None:
        """Begin with the present count, which `read` returns."""
        self._read, self._ml = read, ml_per_count
        self._last = read()
        self._volume_ml = 0.0

    def volume_ml(self, direction: int) -> float:
        """Return the volume until now [ml], into the rig minus out of it.

        Args:
            direction: of the pump since the last call: 1 into the rig, -1 out of it, 0 at rest.

        Raises:
            PumpError: the counter went back.
        """
        now = self._read()
        counted, self._last = now - self._last, now
        if counted < 0.0:
            raise PumpError('its counter went back; it was started again or reset')
        self._volume_ml += direction * counted * self._ml
        return self._volume_ml
