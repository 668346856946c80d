"""The rates of all wells over time, as setpoints, pumps and operator tell them."""

import itertools
import math
from collections import deque
from collections.abc import Iterable, Sequence

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S, to_ml_h
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.order_delay import OrderDelay
from porotwin_core.rates.plausible_rates import refuse_too_great
from porotwin_core.rates.rates_in_force import (
    SAME_RATE,
    KnownRates,
    RatePeriod,
    latest_known,
    rates_at_end,
    rates_in_force,
    same_rates,
)
from porotwin_core.rates.wells import (
    RateStep,
    WellRate,
    WellRates,
    check_plan,
    net_rate,
    net_rate_words,
    planned_rates,
)
from porotwin_core.rig import Rig

KEPT = 4096
"""Rates that are kept: a flow meter at 10 Hz, photographs every 100 s, some of them late."""

LONGEST_HORIZON_S = DAY_S
"""Longest horizon of a forecast [s]: experiments last hours."""

UNBALANCED_SHARE = 0.01
"""Share of the injected water that may be missing at the producer of a proposal for a closed rig:
measured rates never add up to zero exactly, and pumps differ by 1 %."""

MOST_STEPS = 100
"""Most changes of a question: each costs every sibling a flow field or more."""


class RateLog:
    """Remembers rates until the states they lead to have been used.

    It believes what the hub believes: measured rates, then confirmed ones until a newer setpoint,
    then the setpoint, unless a person who tells when an order was set has not told it yet.
    """

    def __init__(self, assumed: WellRates, wells: tuple[str, ...] = ()) -> None:
        """Begin with `assumed` rates [m^3/s], which hold until any others are known.

        `wells` are the control wells.
        """
        self._wells = wells
        self._commanded: deque[tuple[float, WellRates]] = deque([(float('-inf'), assumed)], KEPT)
        self._known: deque[KnownRates] = deque(maxlen=KEPT)
        self._before: WellRates = assumed
        self._delay = OrderDelay()
        self.pauses: FixedPauses = NO_PAUSES
        """Announced pauses of the fixed wells, on the clock of the photographs."""

    def add_commanded(self, stamp: float, rates: WellRates) -> None:
        """Add a setpoint, which holds from the `stamp` [s] of its photograph."""
        self._delay.ordered(stamp, rates, self.commanded_at(stamp), self._wells)
        self._commanded.append((stamp, rates))

    def add_known(self, known: KnownRates) -> None:
        """Add rates that were measured or confirmed."""
        self._known.append(known)

    def is_commanded(self, stamp: float) -> bool:
        """Return whether the setpoint of the photograph at `stamp` [s] is here."""
        return any(abs(item[0] - stamp) < SAME_STAMP_S for item in self._commanded)

    def commanded_at(self, time: float) -> WellRates:
        """Return the setpoint of the newest photograph until `time` [s].

        Of two setpoints with the same stamp, the one that arrived later counts.
        """
        past = [item for item in reversed(self._commanded) if item[0] <= time]
        return max(past, key=lambda item: item[0])[1] if past else self._commanded[0][1]

    def take(self, start: float, end: float) -> tuple[RatePeriod, ...]:
        """Return the rates in force from `start` to `end` [s], and forget older ones."""
        self._delay.learn([item for item in self._known if item.start <= end], end)
        stamps = sorted({stamp for stamp, _ in self._commanded if start < stamp < end})
        periods: list[RatePeriod] = []
        for low, high in zip([start, *stamps], [*stamps, end], strict=True):
            known = self._not_superseded(low)
            periods += rates_in_force(
                known,
                low,
                high,
                commanded=self._believed(low),
                before=self._before,
                pauses=self.pauses,
            )
            self._before = rates_at_end(known, periods)
        self._forget(end)
        return tuple(periods)

    def _believed(self, time: float) -> WellRates:
        return self._delay.believed(self.commanded_at(time), self._before)

    def _newest_stamp(self, time: float) -> float:
        """Return the stamp [s] of the newest setpoint until `time` [s]; -inf without any."""
        return max((stamp for stamp, _ in self._commanded if stamp <= time), default=-math.inf)

    def _not_superseded(self, time: float) -> list[KnownRates]:
        """Return the known rates that no setpoint until `time` [s] replaces."""
        stamp = self._newest_stamp(time)
        return [item for item in self._known if not item.is_open or item.start >= stamp]

    def _forget(self, time: float) -> None:
        newest = self._newest_stamp(time), self.commanded_at(time)
        newer = [item for item in self._commanded if item[0] > time]
        self._commanded = deque([newest, *newer], KEPT)
        held = [item for item in self._not_superseded(time) if item.is_open or item.end > time]
        self._known = deque(held, KEPT)

    def forget_later(self, time: float) -> None:
        """Forget setpoints and rates stamped after `time` [s]: the clock has gone back to it."""
        kept = [item for item in self._commanded if item[0] <= time]
        self._commanded = deque(kept or [(-math.inf, self._before)], KEPT)
        self._known = deque([item for item in self._known if item.end <= time], KEPT)
        self._delay.begin_anew()

    def present_plan(self, time: float, horizon: float) -> tuple[RateStep, ...]:
        """Return the rates from `time` [s] over `horizon` [s], as far as they are known.

        Rates that the operator confirmed hold until a newer setpoint replaces them. A setpoint
        holds at once, or after the time that a person is expected to need for it. Announced pauses
        are in the plan.
        """
        known = list(self._known)
        self._delay.learn(known, time)
        confirmed = [item for item in self._not_superseded(time) if item.is_open]
        pumped = latest_known(confirmed, math.inf) or self._believed(time)
        ahead = self._delay.ahead(time, pumped)
        steps = [RateStep(0.0, pumped)]
        if ahead.waits:
            steps = [*ahead.steps]
            if not steps or not same_rates(steps[-1].rates, self.commanded_at(time)):
                steps.append(RateStep(ahead.lead, self.commanded_at(time)))
        return self.pauses.in_plan(steps, time, horizon)


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


def check_steps(steps: Sequence[RateStep]) -> None:
    """Return if the `steps` of a question are few, and their times increase.

    Raises:
        InputError: there are too many, or they are not in order.
    """
    if len(steps) > MOST_STEPS:
        raise InputError(
            f'proposal: {len(steps)} changes are more than the {MOST_STEPS} that are answered; '
            'ask for fewer'
        )
    for before, step in itertools.pairwise(steps):
        if step.start <= before.start:
            raise InputError(
                f'proposal: a change at {step.start:g} s follows one at {before.start:g} s; '
                'give times that increase, and one change for each'
            )


def check_roles(steps: Sequence[RateStep], rig: Rig) -> None:
    """Return if every control well injects in all `steps`, and the producer never does.

    Raises:
        InputError: a pump would have to run backwards.
    """
    if rig.control is None:
        return
    for name, rate in (item for step in steps for item in step.rates.items()):
        told = f"proposal: well '{name}' at {to_ml_h(rate.rate):g} ml/h"
        if name in rig.control.wells and rate.rate < -SAME_RATE:
            raise InputError(f'{told}: a control well only injects; give 0 or more')
        if name == rig.control.producer and rate.rate > SAME_RATE:
            raise InputError(f'{told}: the producer never injects; give 0 or less, or leave it out')


def check_balance(plan: Sequence[RateStep], present: Sequence[RateStep], rig: Rig) -> None:
    """Return if the proposed `plan` can be in a closed rig: as much is injected as produced.

    Rates of the `present` plan are as they are.

    Raises:
        InputError: a step of the plan does not balance, and all sides of the rig are closed.
    """
    if not rig.closed:
        return
    held = [step.rates for step in present]
    for step in plan:
        net = net_rate(step.rates)
        pumped = math.fsum(abs(well.rate) for well in step.rates.values()) / 2.0
        if abs(net) > UNBALANCED_SHARE * pumped and step.rates not in held:
            producer = rig.control.producer if rig.control is not None else None
            remedy = f'leave out {producer}, which then balances' if producer else 'balance them'
            raise InputError(
                f'proposal: {net_rate_words(net)} from {step.start / 60.0:.4g} min after the state '
                f'on, but all sides of the rig are closed; {remedy}, or open a side in rig.yaml'
            )


def concentration_note(plans: Iterable[Sequence[RateStep]], rig: Rig) -> str:
    """Return one line on wells that inject another concentration than rig.yaml; '' without any.

    It is no fault: a laboratory may dilute its tracer. But a slip looks the same.
    """
    if rig.control is None:
        return ''
    usual = {name: well.concentration for name, well in rig.control.fixed.items()}
    usual |= dict.fromkeys(rig.control.wells, 0.0)
    others = {
        name: well.concentration
        for plan in plans
        for step in plan
        for name, well in step.rates.items()
        if well.rate > SAME_RATE
        and not math.isclose(well.concentration, usual.get(name, well.concentration))
    }
    if not others:
        return ''
    told = ', '.join(
        f'{name} injects a concentration of {found:g} by the rates, {usual[name]:g} by rig.yaml'
        for name, found in others.items()
    )
    return f'note: {told}; the forecast follows the rates (0 is water, 1 is stock)'


def check_proposal(steps: Sequence[RateStep], horizon: float, rig: Rig) -> None:
    """Return if proposed `steps` may be run over `horizon` [s] on `rig`.

    Raises:
        InputError: the horizon is too long, a step lies beyond it or before the state, or a rate is
            not plausible.
    """
    if not 0.0 < horizon <= LONGEST_HORIZON_S:
        raise InputError(
            f'horizon {horizon:g} s: must be above 0 and at most {LONGEST_HORIZON_S:g} s; '
            'correct it'
        )
    for step in steps:
        refuse_too_great(step.rates, rig)
        if not step.start >= 0.0:
            raise InputError(
                f'proposal: a change {step.start:g} s after the state lies before the state; '
                'give a time of 0 s or more'
            )
        if step.start >= horizon:
            raise InputError(
                f'proposal: a change {step.start:g} s after the state lies beyond the horizon of '
                f'{horizon:g} s; give an earlier time or a longer horizon'
            )


def proposed_plan(
    steps: Sequence[RateStep], present: Sequence[RateStep], producer: str | None
) -> tuple[RateStep, ...]:
    """Return the plan of a proposal beside the `present` plan.

    A well that no step has named yet follows the present plan. A named one keeps its proposed rate
    until the next step that names it. A `producer` without a step takes out all that the other
    wells inject, as soon as a rate differs from the present plan.
    """
    named = {name for step in steps for name in step.rates}
    plan: list[RateStep] = []
    for start in sorted({step.start for step in (*present, *steps)}):
        before = planned_rates(present, start)
        rates: dict[str, WellRate] = dict(before)
        for step in steps:
            if step.start <= start:
                rates.update(step.rates)
        if producer is not None and producer not in named and not same_rates(rates, before):
            others = {name: rate for name, rate in rates.items() if name != producer}
            rates[producer] = WellRate(-net_rate(others))
        if not plan or not same_rates(plan[-1].rates, rates):
            plan.append(RateStep(start, rates))
    return tuple(plan)
