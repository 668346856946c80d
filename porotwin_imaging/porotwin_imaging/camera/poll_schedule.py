"""When a camera source is asked for photographs: on time, and with growing pauses while absent."""

import time
from collections.abc import Callable

FIRST_PAUSE_S = 1.0
"""Pause after the first failure [s]; doubled with every failure in a row."""
LONGEST_PAUSE_S = 60.0
"""Longest pause [s]: a camera that is back is found within a minute."""


class PollSchedule:
    """Says when the next poll is due.

    Args:
        interval_s: time between polls [s].
        clock: returns the time of a steady clock [s].
    """

    def __init__(self, interval_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.interval_s = interval_s
        self._clock = clock
        self._due = clock()
        self._failures = 0

    def is_due(self) -> bool:
        """Return whether a poll is due."""
        return self._clock() >= self._due

    def polled(self, *, failed: bool, arriving: bool = False) -> None:
        """Plan the next poll: at once if a photograph is `arriving`, with a pause if it `failed`.

        All others keep their rhythm; late ones are not made up.
        """
        now = self._clock()
        if failed:
            pause = FIRST_PAUSE_S * 2.0 ** min(self._failures, 16)
            self._failures += 1
            self._due = now + min(pause, LONGEST_PAUSE_S)
            return
        self._failures = 0
        self._due = now if arriving else max(self._due + self.interval_s, now)
