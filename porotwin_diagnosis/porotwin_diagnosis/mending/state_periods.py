"""The rates between the states of a running twin, for its shadow forecasts."""

from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import RatePeriod, to_predict
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.live_run import is_other_clock


class StatePeriods:
    """Follows states and rates of a twin; times are stamps of photographs [s]."""

    def __init__(self, rig: Rig) -> None:
        """Know no state and no rates of the wells of `rig`."""
        self.rates = RateHistory.of(rig)
        """The rates since the last state."""
        self.newest: float | None = None
        """Time of the newest state [s]; None before the first one."""

    def is_other_clock(self, stamp: float) -> bool:
        """Return whether the clock was set between the newest state and that at `stamp` [s]."""
        return self.newest is not None and is_other_clock(self.newest, stamp)

    def until(self, stamp: float) -> tuple[RatePeriod, ...]:
        """Return the rates from the last state to that at `stamp` [s], which is the newest now.

        There are none if no rates are known, or if the clock was set between both. The times of all
        earlier rates are wrong then, and only the last ones stay in force.
        """
        last, is_other = self.newest, self.is_other_clock(stamp)
        self.newest = stamp
        if is_other:
            self.rates.begin_anew(stamp)
        self.rates.reach(stamp)
        if last is None or is_other or self.rates.begins is None:
            return ()
        periods = self.rates.periods(last, stamp)
        self.rates.forget_before(stamp)
        return to_predict(periods)
