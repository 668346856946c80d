"""The motor of every pretended pump."""

from collections.abc import Callable

ClockFn = Callable[[], float]
"""Returns a time [s]."""


class PretendedMotor:
    """Counts the volume of a pump; a subclass says how fast it runs, and answers questions."""

    running_ml_h: float
    """Its rate now [ml/h], negative when it withdraws."""

    def __init__(self, clock: ClockFn) -> None:
        """Begin with nothing pumped."""
        self.infused_ml = 0.0
        self.withdrawn_ml = 0.0
        self._clock = clock
        self._seen = clock()

    def pump(self) -> None:
        """Pump until now; it comes before each change of the rate."""
        now = self._clock()
        volume_ml = self.running_ml_h * (now - self._seen) / 3600.0
        self.infused_ml += max(volume_ml, 0.0)
        self.withdrawn_ml += max(-volume_ml, 0.0)
        self._seen = now
