"""What the wells pump: one well's rate, all wells at once, and the schedule over time."""

import bisect
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from porotwin_core.errors import InputError


@dataclass(frozen=True)
class WellRate:
    """One well: `rate` [m^3/s], positive injects, negative produces.

    `concentration` is that of the injected fluid relative to the tracer stock (0 water, 1 stock);
    it has no meaning for a producing well.
    """

    rate: float = 0.0
    concentration: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.rate):
            raise InputError(f'well rate {self.rate} m^3/s: give a finite number')
        if not 0.0 <= self.concentration <= 1.0:
            raise InputError(
                f'injected concentration {self.concentration}: must lie between 0 (water) and 1'
            )


WellRates = Mapping[str, WellRate]
"""Rates by well name; a well that is not named pumps nothing."""


def net_rate(rates: WellRates) -> float:
    """Return the sum of all rates [m^3/s]; positive where more is injected than produced."""
    return math.fsum(well.rate for well in rates.values())


@dataclass(frozen=True)
class ScheduleRow:
    """From `time` [s] on, until its next row, `well` is told to pump `rate`."""

    time: float
    well: str
    rate: WellRate


@dataclass(frozen=True)
class Schedule:
    """What every pump was told over time; rows in the order of their times."""

    rows: tuple[ScheduleRow, ...] = ()
    _times: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        rows = tuple(sorted(self.rows, key=lambda row: row.time))
        object.__setattr__(self, 'rows', rows)
        object.__setattr__(self, '_times', tuple(row.time for row in rows))

    @classmethod
    def constant(cls, rates: WellRates) -> 'Schedule':
        """Return the schedule that pumps the same from the start on."""
        return cls(tuple(ScheduleRow(0.0, well, rate) for well, rate in rates.items()))

    @classmethod
    def from_rates(cls, told: Iterable[tuple[float, WellRates]]) -> 'Schedule':
        """Return the schedule of all rates told at each time, without rows that change nothing."""
        rows: list[ScheduleRow] = []
        current: dict[str, WellRate] = {}
        for time, rates in sorted(told, key=lambda item: item[0]):
            stopped = {well: WellRate() for well in current if well not in rates}
            for well, rate in {**rates, **stopped}.items():
                if current.get(well) != rate:
                    rows.append(ScheduleRow(time, well, rate))
                    current[well] = rate
        return cls(tuple(rows))

    def at(self, time: float) -> dict[str, WellRate]:
        """Return the rates of all wells named so far that hold from `time` [s] on."""
        return {row.well: row.rate for row in self.rows[: bisect.bisect_right(self._times, time)]}

    def intervals(
        self, start: float, end: float
    ) -> Iterator[tuple[float, float, dict[str, WellRate]]]:
        """Yield (start, end, rates) of constant rates that cover `start` to `end` [s]."""
        changes = sorted({time for time in self._times if start < time < end})
        edges = [start, *changes, end]
        for low, high in itertools.pairwise(edges):
            if high > low:
                yield low, high, self.at(low)

    @property
    def wells(self) -> tuple[str, ...]:
        """Names of the wells, in the order of their first rows."""
        return tuple(dict.fromkeys(row.well for row in self.rows))
