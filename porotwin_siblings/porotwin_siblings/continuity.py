"""Whether a photograph follows from the last one, and the rates between both."""

from typing import Protocol

from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import RatePeriod, to_predict


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
    time: float, siblings: FollowsPhotographs, rates: RateHistory, *, interrupted: bool
) -> tuple[RatePeriod, ...]:
    """Return the rates from the last photograph to that at `time` [s]; none if it does not follow.

    The siblings forget the states before an interruption, and everything if the clock went back.
    """
    if siblings.started and time <= siblings.time:
        siblings.begin_anew()
        rates.begin_anew(time)
    rates.reach(time)
    periods = rates.periods(siblings.time, time) if siblings.started else ()
    rates.forget_before(time)
    if not interrupted:
        return to_predict(periods)
    siblings.interrupt()
    return ()
