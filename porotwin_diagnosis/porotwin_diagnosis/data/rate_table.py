"""Rates of a running experiment in a table of fixed size: memory does not grow with time."""

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.order_delay import MOST_DELAY_S
from porotwin_core.rates.wells import WellRate, WellRates, mean_rates

MOST_ROWS = 4096
"""Rows of the table: setpoints and measurements every 30 s for 17 hours. Beyond it the older half
is replaced by mean rates over pairs of rows, which keep the volumes of water and tracer."""


class RateTable:
    """Rates of all wells from a time on, either commanded or measured.

    As in the hub, a person who has told when an order was set is expected to tell it again: until
    then the rates before it hold, for `MOST_DELAY_S` at most.
    """

    def __init__(self, wells: Sequence[str], most: int = MOST_ROWS) -> None:
        """Make an empty table of `most` rows for `wells`."""
        self._wells = tuple(wells)
        self._most = most
        # not zeros: the memory is taken now, so that it does not grow later
        self._start = np.full(most, np.nan)
        self._commanded = np.full(most, True)
        self._values = np.full((most, len(self._wells), 2), np.nan)
        self._count = 0
        self._told: float | None = None
        """Time at which a person last told that rates were set [s]."""
        self._measured_from = -math.inf

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def add(self, start: float, rates: WellRates, *, commanded: bool) -> None:
        """Add `rates` [m^3/s] that hold from `start` [s] on.

        Raises:
            InputError: a well is unknown.
        """
        self._check(rates)
        if self._count == self._most:
            self._halve_older_half()
        self._put(self._count, start, rates, commanded)
        self._count += 1

    def add_commanded(self, stamp: float, rates: WellRates) -> None:
        """Add the `rates` [m^3/s] of a setpoint, in force from `stamp` [s] on.

        They change nothing if rates from that time on have been measured or told already.

        Raises:
            InputError: a well is unknown.
        """
        if stamp > self._measured_from:
            self.add(stamp, rates, commanded=True)

    def add_measured(self, start: float, end: float, rates: WellRates) -> None:
        """Add `rates` [m^3/s] that were measured from `start` to `end` [s].

        They replace the commanded rates of that interval and stay in force after it. If both times
        are equal, a person has told that the rates were set then.

        Raises:
            InputError: a well is unknown; the commanded rates stay.
        """
        self._check(rates)
        times = self._start[: self._count]
        replaced = (start <= times) & (times < end)  # a setpoint at the end holds from then on
        if start == end:
            replaced = times == start
            if self._told is not None:
                replaced |= (max(self._told, start - MOST_DELAY_S) < times) & (times < start)
            self._told = start
        inside = self._commanded[: self._count] & replaced
        self._keep(np.flatnonzero(~inside))
        self.add(start, rates, commanded=False)
        self._measured_from = start

    def _check(self, rates: WellRates) -> None:
        unknown = sorted(set(rates) - set(self._wells))
        if unknown:
            known = ', '.join(self._wells)
            raise InputError(f"well '{unknown[0]}' is not in rig.yaml; known: {known}")

    def begin_anew(self, start: float) -> None:
        """Drop all rows except the last one, which now holds from `start` [s] on."""
        self._keep(np.arange(max(self._count - 1, 0), self._count))
        self._start[: self._count] = start
        self._told, self._measured_from = None, -math.inf

    def rows(self, now: float) -> Iterator[tuple[float, dict[str, WellRate]]]:
        """Yield the time [s] and the rates of every row, in order of arrival.

        Orders that a person will still tell at the time `now` [s] are left out.
        """
        for row in range(self._count):
            time = float(self._start[row])
            told = self._told is not None and time > self._told
            if not (told and self._commanded[row] and now - time <= MOST_DELAY_S):
                yield time, self._rates(row)

    def _rates(self, row: int) -> dict[str, WellRate]:
        return {
            name: WellRate(float(rate), float(concentration))
            for name, (rate, concentration) in zip(self._wells, self._values[row], strict=True)
            if not np.isnan(rate)
        }

    def _put(self, row: int, start: float, rates: WellRates, commanded: bool) -> None:
        self._start[row], self._commanded[row] = start, commanded
        self._values[row] = np.nan
        for name, well in rates.items():
            self._values[row, self._wells.index(name)] = well.rate, well.concentration

    def _keep(self, rows: NDArray[np.intp]) -> None:
        count = len(rows)
        for column in (self._start, self._commanded, self._values):
            column[:count] = column[rows]
        self._count = count

    def _halve_older_half(self) -> None:
        """Replace pairs of rows of the older half by their mean rates."""
        self._keep(np.argsort(self._start[: self._count], kind='stable'))
        half = self._count // 4 * 2
        for pair, first in enumerate(range(0, half, 2)):
            commanded = bool(self._commanded[first : first + 2].all())
            start = float(self._start[first])
            self._put(pair, start, self._mean_of_two(first), commanded)
        kept = np.concatenate([np.arange(half // 2), np.arange(half, self._count)])
        self._keep(kept)

    def _mean_of_two(self, first: int) -> WellRates:
        """Return the mean rates of row `first` and the next one."""
        edges = [float(time) for time in self._start[first : first + 3]]
        periods = [
            (low, high, self._rates(first + number))
            for number, (low, high) in enumerate(itertools.pairwise(edges))
            if high > low
        ]
        return mean_rates(periods) if periods else self._rates(first + 1)
