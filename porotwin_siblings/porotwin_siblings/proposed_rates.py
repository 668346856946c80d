"""Proposed rates: their checks, and the plan that they make beside the present one."""

import itertools
from collections.abc import Callable, Iterable, Sequence

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S
from porotwin_core.rates.rate_periods import same_rates
from porotwin_core.rates.told_rates import imbalance, other_fluids, refuse_impossible
from porotwin_core.rates.wells import (
    RateStep,
    WellRate,
    net_rate,
    planned_rates,
)
from porotwin_core.rig import Rig

LONGEST_HORIZON_S = DAY_S
"""Longest horizon of a forecast [s]: experiments last hours."""

MOST_STEPS = 100
"""Most changes of a question: each costs every sibling a flow field or more."""


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


def after_the_state(start: float) -> str:
    """Return the words for `start` [s] after the state."""
    return f'{start:g} s after the state'


def check_balance(
    plan: Sequence[RateStep],
    present: Sequence[RateStep],
    rig: Rig,
    moment: Callable[[float], str] = after_the_state,
) -> None:
    """Return if the proposed `plan` can be in a closed rig: as much is injected as produced.

    Rates of the `present` plan are as they are. `moment` puts the start of a step into words.

    Raises:
        InputError: a step of the plan does not balance, and all sides of the rig are closed.
    """
    if not rig.closed:
        return
    held = [step.rates for step in present]
    for step in plan:
        words = imbalance(step.rates, rig)
        if words and step.rates not in held:
            producer = rig.control.producer if rig.control is not None else None
            remedy = f'leave out {producer}, which then balances' if producer else 'balance them'
            raise InputError(
                f'proposal: {words} from {moment(step.start)} on, but all sides of the rig are '
                f'closed; {remedy}, or open a side in rig.yaml'
            )


def concentration_note(plans: Iterable[Sequence[RateStep]], rig: Rig) -> str:
    """Return one line on wells that inject another concentration than rig.yaml; '' without any.

    It is no fault: a laboratory may dilute its tracer. But a slip looks the same.
    """
    others = {
        name: f'{name} injects a concentration of {step.rates[name].concentration:g} by the rates, '
        f'{fluid:g} by rig.yaml'
        for plan in plans
        for step in plan
        for name, fluid in other_fluids(step.rates, rig).items()
    }
    if not others:
        return ''
    told = ', '.join(others.values())
    return f'note: {told}; the forecast follows the rates (0 is water, 1 is stock)'


def check_proposal(
    steps: Sequence[RateStep],
    horizon: float,
    rig: Rig,
    moment: Callable[[float], str] = after_the_state,
) -> None:
    """Return if proposed `steps` may be run over `horizon` [s] on `rig`.

    `moment` puts the start of a step into words.

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
        refuse_impossible(step.rates, rig)
        if not step.start >= 0.0:
            raise InputError(
                f'proposal: a change at {moment(step.start)} lies before the state; '
                'give a time of 0 s or more'
            )
        if step.start >= horizon:
            raise InputError(
                f'proposal: a change at {moment(step.start)} lies beyond the horizon of '
                f'{horizon:g} s; give an earlier time or a longer horizon'
            )


def proposed_plan(
    steps: Sequence[RateStep], present: Sequence[RateStep], producer: str | None
) -> tuple[RateStep, ...]:
    """Return the plan of a proposal beside the `present` plan.

    A well that no step has named yet follows the present plan. A named one keeps its proposed rate
    until the next step that names it. Until a step names it, a `producer` takes out all that the
    other wells inject, as soon as a rate differs from the present plan.
    """
    plan: list[RateStep] = []
    for start in sorted({step.start for step in (*present, *steps)}):
        before = planned_rates(present, start)
        named: dict[str, WellRate] = {}
        for step in steps:
            if step.start <= start:
                named.update(step.rates)
        rates = {**before, **named}
        if producer is not None and producer not in named and not same_rates(rates, before):
            others = {name: rate for name, rate in rates.items() if name != producer}
            rates[producer] = WellRate(-net_rate(others))
        if not plan or not same_rates(plan[-1].rates, rates):
            plan.append(RateStep(start, rates))
    return tuple(plan)
