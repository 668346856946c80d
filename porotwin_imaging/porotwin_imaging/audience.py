"""Whether all who want photographs are there: each is sent once, who comes later misses it."""

import time
from collections.abc import Callable

PATIENCE = 30.0
"""Longest wait [s] for a listener that is expected and does not come: the others go on without."""


class Audience:
    """Waits for `expected` listeners; `clock` gives seconds of a steady clock."""

    def __init__(self, expected: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._expected = expected
        self._clock = clock
        self._since: float | None = None

    def is_complete(self, listening: int, known: int) -> bool:
        """Return whether photographs may be sent to the `listening` of the `known` listeners.

        One that is known and does not listen asks for the topic in another way than it is sent.
        """
        if listening == 0:
            self._since = None
            return False
        if self._since is None:
            self._since = self._clock()
        complete = listening >= max(known, self._expected)
        return complete or self._clock() - self._since >= PATIENCE
