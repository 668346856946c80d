"""The rates of the wells over an interval: measured, confirmed or commanded."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.wells import WellRate, WellRates, mean_rates, net_rate
from porotwin_core.rig import PUMP_STEP_ML_H

CONCENTRATION_TOLERANCE = 1e-6
"""Round-off allowed in injected concentrations [-]."""

SAME_RATE = from_ml_h(0.5 * PUMP_STEP_ML_H)
"""Rates that differ by at most this are the same setting of a pump [m^3/s]."""

PUMP_ACCURACY = 0.02
"""Share of its rate by which a pump may be wrong without a remark; the paper's producer delivers
1 % too little (section 4)."""

SHORTEST_PERIOD_S = 0.5
"""Edges closer than this [s] coincide: clocks of pumps and cameras agree no better."""

MOST_PERIODS = 8
"""Periods of one interval that are predicted one by one; more of them count by their mean rates."""


class KnownRates(NamedTuple):
    """Rates [m^3/s] that the pumps measured or the operator confirmed.

    Measured rates hold from `start` to `end` [s], on the clock of the photographs. Confirmed rates
    hold from `start` until other rates are known; their `end` equals `start`.
    """

    start: float
    end: float
    rates: WellRates

    @property
    def is_open(self) -> bool:
        """Whether the rates hold until something else is known."""
        return self.end <= self.start


class RatePeriod(NamedTuple):
    """Constant rates from `start` to `end` [s]."""

    start: float
    end: float
    rates: WellRates


def rates_in_force(
    known: Sequence[KnownRates],
    start: float,
    end: float,
    *,
    commanded: WellRates,
    before: WellRates,
    pauses: FixedPauses = NO_PAUSES,
) -> tuple[RatePeriod, ...]:
    """Return the periods of constant rates that cover `start` to `end` [s].

    Of several known rates, the latest count. Where no rates are known, the `commanded` rates count
    as pumped. One exception: until the operator confirms a change, the rates at the end of the
    last interval (`before`) count. Where no rates are known, fixed wells rest in their announced
    pauses.

    Args:
        known: measured and confirmed rates, in any order.
        start: the beginning of the interval [s].
        end: the end of the interval [s], after `start`.
        commanded: the rates of the setpoint in force.
        before: the rates at the end of the last interval.
        pauses: announced pauses of the fixed wells, on the clock of `start`.
    """

    inside = known_within(known, start, end)
    moments = {moment for item in inside for moment in (item.start, item.end)}
    moments |= pauses.moments(start + SHORTEST_PERIOD_S, end - SHORTEST_PERIOD_S)
    edges = [start, *sorted(moment for moment in moments if start < moment < end), end]
    periods: list[RatePeriod] = []
    for low, high in itertools.pairwise(edges):
        rates = _known_at(inside, low)
        if rates is None:
            awaited = any(item.is_open and item.start > low for item in inside)
            assumed = before if awaited else commanded
            rates = pauses.at(low + SHORTEST_PERIOD_S, assumed)
        if periods and same_rates(periods[-1].rates, rates):
            periods[-1] = periods[-1]._replace(end=high)
        else:
            periods.append(RatePeriod(low, high, rates))
    if len(periods) > MOST_PERIODS:
        return (RatePeriod(start, end, mean_rates(periods)),)
    return tuple(periods)


def rates_at_end(known: Sequence[KnownRates], periods: Sequence[RatePeriod]) -> WellRates:
    """Return the rates in force at the end of the `periods`, from `rates_in_force` with `known`.

    A confirmation that coincides with the end is in no period, but its rates hold from then on.
    """
    end = periods[-1].end
    told = [item for item in known if item.is_open and abs(item.start - end) <= SHORTEST_PERIOD_S]
    return max(told, key=lambda item: item.start).rates if told else periods[-1].rates


def known_within(known: Sequence[KnownRates], start: float, end: float) -> list[KnownRates]:
    """Return the known rates that hold at some time from `start` to `end` [s], sorted by start.

    Moments that coincide with an edge of the interval are moved to it.
    """

    def to_edge(moment: float) -> float:
        edges = [edge for edge in (start, end) if abs(moment - edge) <= SHORTEST_PERIOD_S]
        return edges[0] if edges else moment

    moved = [KnownRates(to_edge(item.start), to_edge(item.end), item.rates) for item in known]
    inside = [item for item in moved if item.start < end and (item.is_open or item.end > start)]
    return sorted(inside, key=lambda item: item.start)


def _known_at(known: Sequence[KnownRates], moment: float) -> WellRates | None:
    """Return the rates among `known`, sorted by start, that began last and hold at `moment` [s]."""
    holding = [
        item.rates for item in known if item.start <= moment and (item.is_open or item.end > moment)
    ]
    return holding[-1] if holding else None


def latest_known(known: Sequence[KnownRates], moment: float) -> WellRates | None:
    """Return the known rates that began last before `moment` [s]; None if there are none."""
    begun = [item for item in known if item.start <= moment + SHORTEST_PERIOD_S]
    return max(begun, key=lambda item: item.start).rates if begun else None


def same_rates(first: WellRates, second: WellRates) -> bool:
    """Return whether both are the same rates with the same fluids."""
    return not different_wells(first, second)


def different_wells(first: WellRates, second: WellRates, *, accuracy: float = 0.0) -> list[str]:
    """Return the names of the wells whose rate or injected fluid differs.

    Rates also count as equal if they differ by at most `accuracy` times the second rate.
    """
    return [
        name
        for name in dict.fromkeys([*first, *second])
        if not _same(first.get(name, WellRate()), second.get(name, WellRate()), accuracy)
    ]


def _same(first: WellRate, second: WellRate, accuracy: float) -> bool:
    if abs(first.rate - second.rate) > max(SAME_RATE, accuracy * abs(second.rate)):
        return False
    injects = min(first.rate, second.rate) > 0.0
    return not injects or abs(first.concentration - second.concentration) <= CONCENTRATION_TOLERANCE


def balanced(rates: WellRates, producer: str) -> dict[str, WellRate]:
    """Return `rates` with the rate of the `producer` that balances all others.

    In a closed rig the net rate is zero, but measured rates never add up to zero exactly.
    """
    others = {name: well for name, well in rates.items() if name != producer}
    return {**others, producer: WellRate(-net_rate(others))}


def injected_tracer(periods: Sequence[RatePeriod]) -> float:
    """Return the volume of tracer stock [m^3] that all wells inject in `periods`."""
    return sum(
        (period.end - period.start) * max(well.rate, 0.0) * well.concentration
        for period in periods
        for well in period.rates.values()
    )


def describe_difference(periods: Sequence[RatePeriod], expected: WellRates) -> str:
    """Return in words, in ml/h, how the mean rates of `periods` differ from the `expected` ones.

    Differences within the accuracy of a pump are left out. The text may be empty.
    """
    mean = periods[0].rates if len(periods) == 1 else mean_rates(periods)
    parts = []
    for name in different_wells(mean, expected, accuracy=PUMP_ACCURACY):
        pumped, planned = mean.get(name, WellRate()), expected.get(name, WellRate())
        part = f'{name} {to_ml_h(pumped.rate):.1f} instead of {to_ml_h(planned.rate):.1f} ml/h'
        if abs(pumped.rate - planned.rate) <= SAME_RATE:
            part = (
                f'{name} with concentration {pumped.concentration:g} instead of '
                f'{planned.concentration:g}'
            )
        parts.append(part)
    return ', '.join(parts)
