"""The lag of the camera's clock behind the guard's clock, from setpoints at a live pace.

Only the pace separates a wrong clock from old photographs: a live camera keeps its lateness, and
a backlog arrives faster than it was taken.
"""

from collections import deque

PROVING_SETPOINTS = 4
"""Setpoints in a row that prove a clock."""

PROVING_INTERVALS = 2.5
"""Photo intervals that they span at least."""

JITTER = 0.25
"""Largest difference of their latenesses, as a part of the photo interval."""


class CameraLag:
    """Believes the camera's clock at first, and then the lag that live setpoints prove."""

    def __init__(self, photo_interval: float) -> None:
        """Begin with clocks that agree; photographs come every `photo_interval` [s]."""
        self._interval = photo_interval
        self._lag = 0.0
        self._odd: deque[tuple[float, float]] = deque(maxlen=PROVING_SETPOINTS)
        """Stamps and latenesses [s] of the last setpoints that came at impossible ages."""

    def age(self, stamp: float, now: float) -> float:
        """Return the age [s] of a photograph stamped `stamp` [s] at the guard's time `now` [s]."""
        return now - stamp - self._lag

    def agrees(self) -> None:
        """Forget the collected latenesses, because a setpoint came in time."""
        self._odd.clear()

    def learns(self, stamp: float, now: float) -> bool:
        """Return whether the last setpoints, including this one, prove another clock."""
        if self._odd and stamp <= self._odd[-1][0]:
            self._odd.clear()
        self._odd.append((stamp, now - stamp))
        latenesses = [late for _, late in self._odd]
        if (
            len(self._odd) < PROVING_SETPOINTS
            or stamp - self._odd[0][0] < PROVING_INTERVALS * self._interval
            or max(latenesses) - min(latenesses) > JITTER * self._interval
        ):
            return False
        self._lag = min(latenesses)
        self._odd.clear()
        return True
