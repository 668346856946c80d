"""The clock of a replay: bag time as a function of wall time."""

import time

from porotwin_recording.mcap.serialization import SECOND


class ReplayClock:
    """Converts between bag time and wall time.

    Bag time runs `rate` times as fast as wall time. With a rate of 0 every moment has come.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._bag_origin = 0
        self._wall_origin = time.monotonic()

    def set(self, log_time: int) -> None:
        """Make `log_time` [ns] the present bag time."""
        self._bag_origin = log_time
        self._wall_origin = time.monotonic()

    def wait_for(self, log_time: int) -> float:
        """Return the wall time until `log_time` [ns], in seconds; 0 if it is past."""
        if self.rate <= 0:
            return 0.0
        elapsed = (log_time - self._bag_origin) / SECOND / self.rate
        return max(0.0, self._wall_origin + elapsed - time.monotonic())

    def now(self) -> int:
        """Return the present bag time [ns]."""
        elapsed = time.monotonic() - self._wall_origin
        return self._bag_origin + int(elapsed * max(self.rate, 0.0) * SECOND)
