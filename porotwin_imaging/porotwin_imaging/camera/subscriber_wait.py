"""Waiting for subscribers: each photograph is published once, so late subscribers would miss it."""

import time
from collections.abc import Callable

LONGEST_WAIT_S = 30.0
"""Longest wait [s] for a missing subscriber; then the photographs go out without it."""


class SubscriberWait:
    """Decides whether photographs may be published.

    Args:
        expected: number of subscribers to wait for.
        clock: returns the time of a steady clock [s].
    """

    def __init__(self, expected: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._expected = expected
        self._clock = clock
        self._since: float | None = None

    def is_over(self, connected: int, known: int) -> bool:
        """Return whether photographs may be published now.

        Args:
            connected: number of connected subscribers.
            known: number of subscribers in the graph. It is larger than `connected` if a quality
                of service is incompatible.
        """
        if connected == 0:
            self._since = None
            return False
        if self._since is None:
            self._since = self._clock()
        complete = connected >= max(known, self._expected)
        return complete or self._clock() - self._since >= LONGEST_WAIT_S
