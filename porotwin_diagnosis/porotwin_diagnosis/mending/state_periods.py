"""The rates between the states of a running twin, for its shadow forecasts."""

from collections.abc import Sequence

from porotwin_core.rates.rates_in_force import RatePeriod
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_diagnosis.data.live_run import is_other_clock
from porotwin_diagnosis.data.rate_table import RateTable


class StatePeriods:
    """Follows states and rates of a twin; times are stamps of photographs [s]."""

    def __init__(self, wells: Sequence[str]) -> None:
        """Know no state and no rates of the `wells`."""
        self._rates = RateTable(wells)
        self.newest: float | None = None
        """Time of the newest state [s]; None before the first one."""

    def add_commanded(self, stamp: float, rates: WellRates) -> None:
        """Add the `rates` of a setpoint, in force from `stamp` [s] until others are measured.

        Raises:
            InputError: a well is unknown.
        """
        self._rates.add_commanded(stamp, rates)

    def add_measured(self, start: float, end: float, rates: WellRates) -> None:
        """Add `rates` that were measured from `start` to `end` [s], or told at that time.

        Raises:
            InputError: a well is unknown.
        """
        self._rates.add_measured(start, end, rates)

    def is_other_clock(self, stamp: float) -> bool:
        """Return whether the clock was set between the newest state and that at `stamp` [s]."""
        return self.newest is not None and is_other_clock(self.newest, stamp)

    def until(self, stamp: float) -> Sequence[RatePeriod]:
        """Return the rates from the last state to that at `stamp` [s], which is the newest now.

        There are none if no rates are known, or if the clock was set between both. The times of all
        earlier rates are wrong then, and only the last ones stay in force.
        """
        last, is_other = self.newest, self.is_other_clock(stamp)
        self.newest = stamp
        if is_other:
            self._rates.begin_anew(stamp)
        if last is None or is_other:
            return ()
        schedule = Schedule.from_rates(self._rates.rows(stamp))
        if not schedule.rows:
            return ()
        return [RatePeriod(*period) for period in schedule.intervals(last, stamp)]
