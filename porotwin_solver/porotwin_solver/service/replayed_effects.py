"""Effects that a replay publishes: which of its messages count, and when a run begins anew."""

from collections import deque


class ReplayedEffects:
    """Tells decisions of a replay from the solver's own messages, and its runs from each other.

    The solver hears its own messages on the same topic. They must not count again: the replay may
    have gone on meanwhile. A text stands for the whole content of a message.
    """

    def __init__(self) -> None:
        """Begin without any message."""
        self._told: deque[str] = deque()
        self._clock = 0
        self._decided = 0

    def tell(self, text: str) -> None:
        """Note a message that the solver publishes."""
        self._told.append(text)

    def is_own(self, text: str) -> bool:
        """Return whether a message that arrives is the solver's own; each one arrives once.

        Messages arrive in their order. So those before it were lost, and are forgotten.
        """
        if text not in self._told:
            return False
        while self._told.popleft() != text:
            pass
        return True

    def decide(self, published: int) -> None:
        """Note that the effects in force were published at wall time `published` [ns]."""
        self._decided = published

    def begins_anew(self, clock: int, published: int) -> bool:
        """Return whether the time of the replay goes back behind the effects in force.

        Args:
            clock: the time of the replay [ns].
            published: the wall time at which the replay told it [ns]. The replay sets the clock
                back first. So effects that it published later belong to the new run, although
                their message may overtake that of the clock.
        """
        went_back, self._clock = clock < self._clock, clock
        return went_back and self._decided < published

    def forget(self) -> None:
        """Begin a new replay: messages of the former one no longer arrive."""
        self._told.clear()
        self._clock = 0
