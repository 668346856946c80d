"""Known rates of the wells, periods of constant rates, and comparisons of rates."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.plausibility import plausible_rate_ml_h
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.clock.stamps import SAME_PHOTOGRAPH_S
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import (
    RateStep,
    WellRate,
    WellRates,
    check_plan,
    mean_rates,
    net_rate,
)
from porotwin_core.rig import PUMP_STEP_ML_H, Rig

ROUND_OFF_ML_H = 1e-3
"""Rates that differ by less are equal [ml/h]: messages and displays are rounded, and no pump is
that exact."""

SAME_RATE = from_ml_h(0.5 * PUMP_STEP_ML_H)
"""Rates that differ by at most this are the same setting of a pump [m^3/s]."""

HAND_SHARE = 0.002
"""Smallest change that a person sets, as a share of a pump's greatest rate: 1 of 500 ml/h."""

PUMP_ACCURACY = 0.02
"""Relative error of a pump that is no remark; the paper's producer delivers
1 % too little (section 4)."""

OPEN_HORIZON_S = 1800.0
"""How far plans and forecasts look ahead where nobody tells the end of the experiment [s]."""

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

    def refuse_impossible(self, largest: float) -> None:
        """Check the times, and that no rate is beyond `largest` [m^3/s], which no pump here has.

        Raises:
            InputError: a rate is larger, or the times are not in order.
        """
        if not (math.isfinite(self.start) and self.start <= self.end):
            late = self.start - self.end
            raise InputError(f'they begin {late:.3f} s after their end; send start <= stamp')
        for name, well in self.rates.items():
            if abs(well.rate) > largest:
                raise InputError(
                    f"well '{name}': {to_ml_h(well.rate):.4g} ml/h, but this rig stands at most "
                    f'{to_ml_h(largest):.4g} ml/h; send m^3/s'
                )


def largest_rate(rig: Rig) -> float:
    """Return the rate [m^3/s] that no pump of `rig` exceeds."""
    return from_ml_h(plausible_rate_ml_h(rig.pore_volume)[1])


class RatePeriod(NamedTuple):
    """Constant rates from `start` to `end` [s]."""

    start: float
    end: float
    rates: WellRates


def joined(periods: Iterable[RatePeriod]) -> list[RatePeriod]:
    """Return consecutive `periods`, neighbours of the same rates joined."""
    result: list[RatePeriod] = []
    for period in periods:
        if result and same_rates(result[-1].rates, period.rates):
            result[-1] = result[-1]._replace(end=period.end)
        else:
            result.append(period)
    return result


def to_predict(periods: Sequence[RatePeriod]) -> tuple[RatePeriod, ...]:
    """Return consecutive `periods` as a model predicts them one by one.

    One no longer than `SAME_PHOTOGRAPH_S` goes to its neighbour. Many count by their mean rates.
    """
    kept: list[RatePeriod] = []
    for period in periods:
        start = period.start
        if kept and kept[-1].end - kept[-1].start <= SAME_PHOTOGRAPH_S:
            start = kept.pop().start
        if kept and period.end - start <= SAME_PHOTOGRAPH_S:
            kept[-1] = kept[-1]._replace(end=period.end)
        else:
            kept.append(period._replace(start=start))
    kept = joined(kept)
    if len(kept) > MOST_PERIODS:
        return (RatePeriod(kept[0].start, kept[-1].end, mean_rates(kept)),)
    return tuple(kept)


def plan_periods(plan: Sequence[RateStep], start: float, horizon: float) -> tuple[RatePeriod, ...]:
    """Return a plan from `start` [s] over `horizon` [s] as periods.

    Raises:
        InputError: as `check_plan`, or the horizon is not above zero.
    """
    check_plan(plan)
    if not 0.0 < horizon < math.inf:
        raise InputError(f'horizon {horizon:g} s: give a finite time above 0 s')
    begins = [step.start for step in plan]
    ends = [*begins[1:], horizon]
    return tuple(
        RatePeriod(start + begin, start + min(end, horizon), step.rates)
        for begin, end, step in zip(begins, ends, plan, strict=True)
        if begin < horizon
    )


def same_rates(first: WellRates, second: WellRates) -> bool:
    """Return whether both are the same rates with the same fluids, and levels of water."""
    rises = [
        {name: well.rise for name, well in rates.items() if well.rise} for rates in (first, second)
    ]
    return rises[0] == rises[1] and not different_wells(first, second)


def same_by_hand(rig: Rig | None) -> float:
    """Return by how much rates may differ that a person leaves as they are [m^3/s]."""
    if rig is None or rig.control is None:
        return SAME_RATE
    return max(SAME_RATE, from_ml_h(HAND_SHARE * rig.control.max_rate_ml_h) - SAME_RATE)


def orders_by_hand(setpoints: Iterable[WellRates], rig: Rig) -> int:
    """Return how many `setpoints` [m^3/s] a person has to set at the pumps, from the safe rates on.

    Changes that no hand sets add up.
    """
    told, count = safe_rates(rig), 0
    for rates in setpoints:
        changed = different_wells(rates, told, same=same_by_hand(rig))
        told |= {well: rates.get(well, WellRate()) for well in changed}
        count += bool(changed)
    return count


def different_wells(
    first: WellRates, second: WellRates, *, accuracy: float = 0.0, same: float = SAME_RATE
) -> list[str]:
    """Return the names of the wells whose rate or injected fluid differs.

    Rates are equal if they differ by at most `same` [m^3/s], or `accuracy` times the second rate.
    """
    return [
        name
        for name in dict.fromkeys([*first, *second])
        if not _same(first.get(name, WellRate()), second.get(name, WellRate()), accuracy, same)
    ]


def _same(first: WellRate, second: WellRate, accuracy: float, same: float) -> bool:
    if (first.rate == 0.0) != (second.rate == 0.0):
        same = SAME_RATE  # a pump that starts or stops is set, however slow it is
    if abs(first.rate - second.rate) > max(same, accuracy * abs(second.rate)):
        return False
    injects = min(first.rate, second.rate) > 0.0
    return not injects or abs(first.concentration - second.concentration) <= WRITTEN_ROUND_OFF


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
