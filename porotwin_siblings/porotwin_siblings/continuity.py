"""Whether a photograph follows from the last one, and the rates between both."""

from typing import Protocol

from porotwin_core.rates.rates_in_force import RatePeriod
from porotwin_siblings.rate_log import RateLog


class FollowsPhotographs(Protocol):
    """The time of the siblings."""

    @property
    def started(self) -> bool:
        """Whether there is a photograph that another one may follow."""

    @property
    def time(self) -> float:
        """Time of the last photograph [s]."""

    def interrupt(self) -> None:
        """Forget the states."""

    def begin_anew(self) -> None:
        """Forget everything."""


def periods_until(
    time: float, siblings: FollowsPhotographs, rates: RateLog, *, interrupted: bool
) -> tuple[RatePeriod, ...]:
    """Return the rates from the last photograph to that at `time` [s]; none if it does not follow.

    The siblings forget the states before an interruption, and everything if the clock went back.
    """
    if siblings.started and time <= siblings.time:
        siblings.begin_anew()
        rates.forget_later(time)
    # also over an interruption: the rates at its end are those before the next order is set
    periods = rates.take(siblings.time, time) if siblings.started else ()
    if not interrupted:
        return periods
    siblings.interrupt()
    return ()
