"""Lines that compare a new finding on a rig with the earlier ones: joint intervals and drifts."""

import math
from collections.abc import Iterator, Sequence

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.basis.units import DAY_S, HOUR_S
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.history.joint_belief import CauseCourse, courses, weighted
from porotwin_diagnosis.history.past_findings import FoundCause, PastFinding, Value
from porotwin_diagnosis.report.wording import at_well, spoken
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number, reading

DRIFT_DEVIATIONS = 2.6
"""Difference of two findings, in standard deviations of it, from which on it is a drift: chance
makes one in a hundred as large."""

NO_STRENGTH = {'exchange_rate'}
"""Scored parameters whose size says nothing about the strength of their effect."""


LEAST_INTERVAL_S = HOUR_S
"""Least time between two recordings for a rate per day [s]."""


def compared(earlier: Sequence[PastFinding], new: PastFinding) -> list[str]:
    """Return lines that compare a `new` finding with the `earlier` ones, sorted by date."""
    if not earlier:
        return ['The history has no earlier finding with this rig.yaml; this is the first one.']
    own = [course for course in courses([*earlier, new]) if course.found[-1][0] is new]
    named = [course for course in own if course.latest.effect in new.named]
    lines = [line for course in named for line in _of_course(course)]
    return [*lines, *_back(earlier, named), *_gone(earlier, new), *_fresh(named)]


def _of_course(course: CauseCourse) -> Iterator[str]:
    """Yield a line for every parameter that an earlier finding holds too."""
    *before, (finding, cause) = course.found
    for name, value in cause.values.items():
        known = [(f, one.values[name]) for f, one in before if name in one.values]
        if not known:
            continue
        what = _of(cause, name)
        now = _number(cause, name, value.value)
        last, old = known[-1]
        change = value.value - old.value
        believed = _with_interval(cause, name, weighted([one for _, one in known]))
        if abs(change) <= DRIFT_DEVIATIONS * math.hypot(value.deviation, old.deviation):
            together = weighted([*(one for _, one in known), value])
            yield (
                f'{what}: {now} now; believed before: {believed}; '
                f'together: {_with_interval(cause, name, together)}.'
            )
            continue
        rate = ''
        if (seconds := finding.seconds - last.seconds) >= LEAST_INTERVAL_S:
            daily = _number(cause, name, abs(change) * DAY_S / seconds, digits=2)
            rate = f' It {"rises" if change > 0.0 else "falls"} by {daily} a day.'
        yield (
            f'{what} drifts: {_number(cause, name, old.value)} on {last.day}, {now} now.{rate}'
            f'{_way(cause, name, old.value, value.value)} Believed before: {believed}.'
        )


def _way(cause: FoundCause, parameter: str, old: float, new: float) -> str:
    """Say whether the effect became weaker or stronger from the `old` value to the `new` one.

    Empty for a place, a radius and a speed of exchange, which say little about the strength.
    """
    described = EFFECTS[cause.effect].parameters[parameter]
    if not described.is_scored or parameter in NO_STRENGTH:
        return ''
    before, after = old - described.neutral, new - described.neutral
    if described.is_factor:  # half and twice as much are equally strong
        before, after = (math.log(max(one, SMALLEST_DIVISOR)) for one in (old, new))
    if before * after < 0.0:
        return ' The effect acts the other way now.'
    return f' The effect is {"stronger" if abs(after) > abs(before) else "weaker"} now.'


def _back(earlier: Sequence[PastFinding], named: Sequence[CauseCourse]) -> Iterator[str]:
    """Yield a line for every cause that an earlier recording between two findings did not show."""
    for course in named:
        for last, cause in course.found[-2:-1]:
            gap = [f for f in earlier if f.verdict == NONE and f.seconds > last.seconds]
            if gap:
                yield f'{_what(cause)} is back: found on {last.day}, not on {gap[-1].day}.'


def _gone(earlier: Sequence[PastFinding], new: PastFinding) -> Iterator[str]:
    """Yield a line for every effect that the last finding named and the new one does not hold."""
    last = earlier[-1]
    if new.verdict == UNEXPLAINED or last.verdict in (NONE, UNEXPLAINED):
        return
    held = {cause.effect for cause in new.causes}
    end = 'does not show today' if new.verdict == NONE else 'is not named today'
    same = {cause.effect for cause in last.causes} - set(last.named)
    for name in dict.fromkeys(last.named):
        if name not in held and not same & held:
            yield f'{spoken(name)}, found on {last.day}, {end}.'


def _fresh(named: Sequence[CauseCourse]) -> Iterator[str]:
    fresh = (course.latest for course in named if len(course.found) == 1)
    for name, placed in sorted({(_what(cause), 'x' in cause.values) for cause in fresh}):
        yield f'{name} is new: no earlier recording showed it{" there" * placed}.'


def _of(cause: FoundCause, parameter: str) -> str:
    if cause.well:
        return f'{spoken(parameter)} of the {spoken(cause.effect)} of {cause.well}'
    return f'{spoken(cause.effect)} {spoken(parameter)}'


def _what(cause: FoundCause) -> str:
    """Return the effect in words; the name of its well stays as rig.yaml spells it."""
    return at_well(cause.effect, cause.well)


def _with_interval(cause: FoundCause, parameter: str, value: Value) -> str:
    middle, low, high = (
        _number(cause, parameter, one) for one in (value.value, value.low, value.high)
    )
    return f'{middle} ({low} to {high})'


def _number(cause: FoundCause, parameter: str, amount: float, digits: int = 3) -> str:
    factor, unit = reading(EFFECTS[cause.effect].parameters[parameter])
    return f'{number(factor * amount, digits)} {unit}'.strip()
