"""The age of photographs, from clocks that need not agree."""

SINCE_1970 = 1e9
"""Stamps below this [s] count from the start of an experiment, not from 1970: they tell no age."""

LIVE_SHARE = 0.5
"""Photographs of a live camera are at least this share of the photo interval apart, by their stamps
as by their arrivals; half an interval allows for jitter."""


class PhotographClock:
    """Finds how late photographs are from their stamps and their times of arrival.

    The camera's clock is trusted until photographs prove it wrong. One photograph from the future
    proves it; so do two late ones that arrive at the pace of a live camera. The photographs of a
    backlog (an old folder, a network share that was away) arrive faster than they were taken.
    """

    def __init__(self, *, interval: float, validity: float) -> None:
        """Begin without any photograph.

        Args:
            interval: time between photographs [s].
            validity: age up to which a photograph may be acted on [s].
        """
        self._interval = interval
        self._validity = validity
        self._behind = 0.0
        """Lag of the camera's clock behind the clock of arrivals [s]."""
        self._trusted = False
        """Whether a photograph was in time according to `_behind`."""
        self._last: tuple[float, float] | None = None
        """Stamp and arrival of the last photograph [s]."""

    def lateness(self, stamp: float, arrival: float) -> float:
        """Return the age [s] of a photograph on arrival; 0 if its stamp is no time since 1970.

        Call it once for every photograph, in the order of their arrivals.

        Args:
            stamp: the time of the photograph by the camera's clock [s].
            arrival: its arrival [s] since 1970, by a clock that is never set; that clock may be as
                wrong as the camera's.
        """
        if stamp < SINCE_1970:
            return 0.0
        late = arrival - stamp
        if self._last is not None:
            taken, came = stamp - self._last[0], arrival - self._last[1]
            if taken <= 0.0:
                self._trusted = False  # a clock was set back, or old photographs come again
            live = came >= LIVE_SHARE * taken >= LIVE_SHARE**2 * self._interval
            if live and not self._trusted:
                self._behind = late
        self._last = (stamp, arrival)
        self._behind = min(self._behind, late)
        self._trusted = self._trusted or late - self._behind <= self._validity
        return late - self._behind
