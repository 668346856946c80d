"""Whether a photograph is new enough to act on, by clocks that need not agree."""

SINCE_1970 = 1e9
"""Stamps below this [s] count from the start of an experiment, not from 1970: nobody's clock."""

LIVE_PACE = 0.5
"""A live camera's photographs are further apart than this share of the interval, and arrive so."""


class PhotographClock:
    """How late photographs are, found from their stamps and the times at which they arrive.

    The camera's clock is believed until the photographs show that it is off: one from the future
    does, and so do two that are late, with the pace of a live camera between them. Those of a
    backlog, a folder of last week or a share that was away, come faster than they were taken.
    """

    def __init__(self, *, interval: float, validity: float) -> None:
        """Take photographs as `interval` [s] apart and as good to act on for `validity` [s]."""
        self._interval = interval
        self._validity = validity
        self._behind = 0.0
        """The camera's clock is behind the arrivals' clock by this [s]."""
        self._nominal = False
        """A photograph was in time by `_behind`."""
        self._last: tuple[float, float] | None = None

    def lateness(self, stamp: float, arrival: float) -> float:
        """Return how long before its `arrival` a photograph was taken at `stamp` [s]; 0: unknown.

        To be asked once for every photograph, in the order of their arrivals. `arrival` is the time
        since 1970 on a clock that is never set; it may be as wrong as the camera's.
        """
        if stamp < SINCE_1970:
            return 0.0
        late = arrival - stamp
        if self._last is not None:
            taken, came = stamp - self._last[0], arrival - self._last[1]
            if taken <= 0.0:
                self._nominal = False  # a clock was set back, or old photographs come again
            live = came >= LIVE_PACE * taken >= LIVE_PACE**2 * self._interval
            if live and not self._nominal:
                self._behind = late
        self._last = (stamp, arrival)
        self._behind = min(self._behind, late)
        self._nominal = self._nominal or late - self._behind <= self._validity
        return late - self._behind
