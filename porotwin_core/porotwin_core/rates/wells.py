"""Rates of wells: of one well, of all wells, and over time."""

import bisect
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.water_levels import NO_LEVELS, WaterLevels


@dataclass(frozen=True, slots=True)
class WellRate:
    """The rate of one well [m^3/s]; positive injects, negative produces.

    `concentration` is the concentration of the injected fluid relative to the tracer stock
    (0 water, 1 stock). It has no meaning for a producing well.

    Beside the wells, rates name the water whose level changes (`levels`): it has no rate, but
    `rise`, its level above the described one [m].

    Raises:
        InputError: the rate is not finite, or the concentration lies outside 0..1.
    """

    rate: float = 0.0
    concentration: float = 0.0
    rise: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.rate):
            raise InputError(f'well rate {self.rate} m^3/s: give a finite number')
        if not math.isfinite(self.rise):
            raise InputError(f'rise {self.rise} m of a level: give a finite number')
        if not 0.0 <= self.concentration <= 1.0:
            raise InputError(
                f'injected concentration {self.concentration}: must lie between 0 (water) and 1'
            )


WellRates = Mapping[str, WellRate]
"""Rates by well name; a well without an entry pumps nothing."""


def with_rises(rates: WellRates, rises: Mapping[str, float]) -> dict[str, WellRate]:
    """Return `rates` with the `rises` [m] of water, by name."""
    return {**rates, **{name: WellRate(rise=rise) for name, rise in rises.items()}}


def without_water(rates: WellRates, wells: Iterable[str]) -> dict[str, WellRate]:
    """Return `rates` of the `wells` of a rig, without the water that they name beside them."""
    return {name: rates[name] for name in wells if name in rates}


def net_rate(rates: WellRates) -> float:
    """Return the sum of all rates [m^3/s]: injection minus production."""
    return math.fsum(well.rate for well in rates.values())


def net_rate_words(net: float) -> str:
    """Return a net rate [m^3/s] in words: which of injection and production is the larger."""
    more = 'injected than produced' if net > 0.0 else 'produced than injected'
    return f'{abs(to_ml_h(net)):.6g} ml/h more is {more}'


class RateStep(NamedTuple):
    """Rates [m^3/s] that hold from `start` [s] until the next step of a plan; the last one stays.

    The times of a plan begin at 0, the time of its initial state.
    """

    start: float
    rates: WellRates


def planned_rates(plan: Sequence[RateStep], time: float) -> WellRates:
    """Return the rates [m^3/s] of a checked `plan` at `time` [s], which is not before its start."""
    return next(step.rates for step in reversed(plan) if step.start <= time)


def check_plan(plan: Sequence[RateStep]) -> None:
    """Check that the steps of a plan begin at 0 and that their times increase.

    Raises:
        InputError: there is no step, the first does not begin at 0, or times do not increase.
    """
    starts = [step.start for step in plan]
    if not starts or starts[0] != 0.0:
        raise InputError('schedule: its first step must begin at 0 s, the time of the state')
    for before, start in itertools.pairwise(starts):
        if not before < start < math.inf:
            raise InputError(
                f'schedule: a step at {start:g} s follows one at {before:g} s; '
                'give finite times that increase'
            )


def plan_intervals(
    plan: Sequence[RateStep], edges: Iterable[float], end: float
) -> Iterator[tuple[float, float, int]]:
    """Yield (start, end, number of the step) of intervals from 0 to `end` [s].

    No interval contains the start of a step or one of the `edges` [s] in its interior.
    """
    starts = [step.start for step in plan]
    moments = sorted({0.0, end, *(time for time in [*starts, *edges] if 0.0 < time < end)})
    for low, high in itertools.pairwise(moments):
        yield low, high, bisect.bisect_right(starts, low) - 1


@dataclass(frozen=True)
class ScheduleRow:
    """One change of one well: it pumps `rate` from `time` [s] until its next row."""

    time: float
    well: str
    rate: WellRate


@dataclass(frozen=True)
class Schedule:
    """The rates of all wells over time, as rows in the order of their times.

    The `levels` of water that change are in its `intervals`.
    """

    rows: tuple[ScheduleRow, ...] = ()
    levels: WaterLevels = NO_LEVELS
    _times: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        rows = tuple(sorted(self.rows, key=lambda row: row.time))
        object.__setattr__(self, 'rows', rows)
        object.__setattr__(self, '_times', tuple(row.time for row in rows))

    @classmethod
    def constant(cls, rates: WellRates) -> 'Schedule':
        """Return the schedule with the same `rates` from time zero on."""
        return cls(tuple(ScheduleRow(0.0, well, rate) for well, rate in rates.items()))

    @classmethod
    def from_rates(cls, rates_by_time: Iterable[tuple[float, WellRates]]) -> 'Schedule':
        """Return the schedule of all rates at given times [s], without rows that change nothing.

        A well that is missing at a time stops then.
        """
        rows: list[ScheduleRow] = []
        current: dict[str, WellRate] = {}
        for time, rates in sorted(rates_by_time, key=lambda item: item[0]):
            stopped = {well: WellRate() for well in current if well not in rates}
            for well, rate in {**rates, **stopped}.items():
                if current.get(well) != rate:
                    rows.append(ScheduleRow(time, well, rate))
                    current[well] = rate
        return cls(tuple(rows))

    def at(self, time: float) -> dict[str, WellRate]:
        """Return the rates from `time` [s] on, of all wells with a row at or before that time."""
        return {row.well: row.rate for row in self.rows[: bisect.bisect_right(self._times, time)]}

    def intervals(
        self, start: float, end: float
    ) -> Iterator[tuple[float, float, dict[str, WellRate]]]:
        """Yield (start, end, rates) of periods of constant rates from `start` to `end` [s]."""
        changes = sorted({time for time in self._times if start < time < end})
        edges = [start, *changes, end]
        for low, high in itertools.pairwise(edges):
            if high > low:
                for first, last, rises in self.levels.parts(low, high):
                    yield first, last, with_rises(self.at(low), rises)

    def mean(self, start: float, end: float) -> dict[str, WellRate]:
        """Return the `mean_rates` from `start` to `end` [s]."""
        return mean_rates(self.intervals(start, end))

    def injected_stock(self, start: float, end: float) -> float:
        """Return the volume of tracer stock [m^3] that all wells inject from `start` to `end` [s].

        A `start` of -inf means the first row.
        Produced tracer does not count, because its concentration is unknown.
        """
        return sum(
            (high - low) * max(well.rate, 0.0) * well.concentration
            for low, high, rates in self.intervals(start, end)
            for well in rates.values()
        )

    @property
    def wells(self) -> tuple[str, ...]:
        """Names of the wells, in the order of their first rows."""
        return tuple(dict.fromkeys(row.well for row in self.rows))

    @property
    def largest(self) -> dict[str, WellRate]:
        """The rate of largest magnitude of every well that pumps at all."""
        largest: dict[str, WellRate] = {}
        for row in self.rows:
            if abs(row.rate.rate) > abs(largest.get(row.well, WellRate()).rate):
                largest[row.well] = row.rate
        return largest

    @property
    def busiest(self) -> dict[str, WellRate]:
        """The rates at the moment at which the wells pump most water together, with its levels."""
        moment = self.busiest_time
        return with_rises(self.at(moment), self.levels.at(moment))

    @property
    def busiest_time(self) -> float:
        """The first moment [s] at which the wells pump most water together; 0 without rows."""
        return max(
            dict.fromkeys(self._times),
            key=lambda time: math.fsum(abs(well.rate) for well in self.at(time).values()),
            default=0.0,
        )


def quoted(wells: Iterable[str]) -> str:
    """Return names of wells in words: 'left' and 'right'."""
    return ' and '.join(f"'{well}'" for well in wells)


def later_commands(commanded: Schedule | None, measured: Schedule) -> list[ScheduleRow]:
    """Return the commands that count after the `measured` rates, which are not empty.

    They are those from the last measured row of all wells on, without those of a well that is
    measured at their time.
    """
    end = measured.rows[-1].time
    there = {row.well for row in measured.rows if row.time == end}
    rows = () if commanded is None else commanded.rows
    return [row for row in rows if row.time > end or (row.time == end and row.well not in there)]


def mean_rates(periods: Iterable[tuple[float, float, WellRates]]) -> dict[str, WellRate]:
    """Return the constant rates that pump as much water and tracer as periods of other rates.

    The mean rate of a well is sum(duration * rate) / sum(duration), and so is the mean rise. Its
    concentration is the mean over its injected water; production does not count.

    Args:
        periods: (start [s], end [s], rates), each longer than zero.
    """
    spans = list(periods)
    duration = sum(end - start for start, end, _ in spans)
    water: dict[str, float] = {}
    injected: dict[str, float] = {}
    tracer: dict[str, float] = {}
    rise: dict[str, float] = {}
    for start, end, rates in spans:
        share = (end - start) / duration
        for name, well in rates.items():
            injection = max(well.rate, 0.0)
            water[name] = water.get(name, 0.0) + share * well.rate
            rise[name] = rise.get(name, 0.0) + share * well.rise
            injected[name] = injected.get(name, 0.0) + share * injection
            tracer[name] = tracer.get(name, 0.0) + share * injection * well.concentration
    return {
        name: WellRate(
            rate,
            min(tracer[name] / injected[name], 1.0) if injected[name] > 0 else 0.0,
            rise[name],
        )
        for name, rate in water.items()
    }
