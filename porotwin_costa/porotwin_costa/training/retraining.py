"""When COSTA is trained again: after so many new pairs, and again if a training was lost."""

import math

SILENCE_S = 300.0
"""A training that has reported nothing for so long is lost [s]; COSTA reports every few seconds."""

RETRY_S = 30.0
"""Time until a refused goal is sent again [s]."""


class Retraining:
    """Decides when to send the next training goal; knows nothing of messages or clocks.

    Times [s] come from any clock that does not jump.
    """

    def __init__(self, every: int, known_pairs: int = 0) -> None:
        """Train after every `every` pairs; `known_pairs` are on disk already."""
        self._every = every
        self._pairs = known_pairs
        self._due = False
        self._running = False
        self._last_report = 0.0
        self._not_before = -math.inf

    def wanted(self, now: float) -> bool:
        """Return whether a goal shall be sent at `now` [s]."""
        return self._due and not self._running and now >= self._not_before

    def pair_added(self) -> bool:
        """Count a new pair; return whether it makes a training due."""
        self._pairs += 1
        due = self._pairs % self._every == 0
        self._due = self._due or due
        return due

    def started(self, now: float) -> None:
        """Note that a goal was sent at `now` [s]."""
        self._due, self._running, self._last_report = False, True, now

    def reported(self, now: float) -> None:
        """Note that the training reported its progress at `now` [s]."""
        self._last_report = now

    def refused(self, now: float) -> None:
        """Note that the goal was refused at `now` [s]: it is sent again after a while."""
        self._due, self._running, self._not_before = True, False, now + RETRY_S

    def finished(self) -> None:
        """Note that the training has ended, with success or not."""
        self._running = False

    def lost(self, now: float, *, server_ready: bool) -> bool:
        """Return whether the running training was lost at `now` [s]; its goal is then sent again.

        That is the case if its node is gone, or has not reported for `SILENCE_S`.
        """
        if not self._running or (server_ready and now - self._last_report <= SILENCE_S):
            return False
        self._due, self._running = True, False
        return True
