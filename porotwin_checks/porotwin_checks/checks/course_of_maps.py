"""Is every map from its time? It follows from the map before, and leads to the map after.

By its shape: a plume that moves on at constant rates makes map k nearly the mean of its
neighbours. The ratio

    r(k) = |m(k) - (m(k - 1) + m(k + 1)) / 2| / |m(k + 1) - m(k - 1)|

is then small: 0 for a wide front, 1/2 for a sharp one. Noise alone makes 0.87, which is
sqrt(3/2) / sqrt(2). Two neighbours that were exchanged make 1.5 with a wide front and 1.1 with a
sharp one.

By its tracer: pumps bring in tracer at their rates, and no more leaves than the fluid that they
move. A map with a jump of tracer up and down, or down and up, is from another time, or its light
is wrong, also while all pumps rest.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from porotwin_checks.known import Known, Maps
from porotwin_checks.tracer_errors import SCALE, believed_change
from porotwin_core.basis.check import Check
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.basis.remark import NAMED, Remark
from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_solver.effects import tracer_storage

LEAST_RATIO = 1.1
"""Least ratio r(k) of a map out of place."""

LEAST_OUTLIER, NEARBY = 1.7, 9
"""The same, relative to the median of that many maps nearby. Noise and flicker make all ratios
large where the plume is slow. With both limits 80 % of the exchanged maps of 143 recordings of
both simulators were found, and one map of one recording was told wrongly."""

MOST_MISPLACED = 4
"""Most maps that are out of place. More are the rule, such as light that flickers, and no slip."""


WORDS = (
    '{count} of {maps} maps fit neither the map before nor the one after them: {named}; were files '
    'swapped, was a clock changed, or is the light of a photograph wrong? Correct their times, or '
    'leave them out'
)


def _find(known: Known) -> Iterator[Remark]:
    assert known.maps is not None
    times = np.asarray(known.times, dtype=float).tolist()
    jumped: dict[int, Jump] = {}
    if known.has('scaled_maps') and known.rates is not None:
        jumped = {jump.number: jump for jump in jumps(known.maps, times, known.rig, known.rates)}
    odd = sorted({*misplaced_maps(times, known.maps, known.rates), *jumped})
    if odd:
        named = [_shown(known.name_of(number), jumped.get(number)) for number in odd[:NAMED]]
        more = [f'{len(odd) - NAMED} more'] if len(odd) > NAMED else []
        yield Remark.of(
            'maps',
            'out_of_course',
            WORDS,
            count=len(odd),
            maps=len(times),
            named=', '.join([*named, *more]),
            times_s=[times[number] for number in odd],
        )


def _shown(name: str, jump: 'Jump | None') -> str:
    """Return the `name` of a map; if it jumps, with its tracer and its neighbours' tracer."""
    if jump is None:
        return name
    return (
        f'{name} shows {jump.held * ML:.3g} ml of tracer, the maps before and after it '
        f'{jump.before * ML:.3g} and {jump.after * ML:.3g} ml'
    )


class Jump(NamedTuple):
    """A map out of its course: its number, and tracer before, in and after it [m^3]."""

    number: int
    before: float
    held: float
    after: float


def jumps(maps: Maps, times: Sequence[float], rig: Rig, schedule: Schedule) -> list[Jump]:
    """Return the maps with more tracer than both neighbours, or less, beyond the rates of pumps.

    Only cells that all three maps know count.

    Args:
        maps: calibrated maps of concentration [-].
        times: their times [s], ascending.
        rig: the rig.
        schedule: the injected rates.
    """
    if len(times) < 3 or not schedule.rows:
        return []
    pores = tracer_storage(rig, rig.grid(*maps[0].shape[::-1]))
    found = [
        Jump(number, *_held((before, now, after), pores))
        for number, ((before, now), (_, after)) in enumerate(pairwise(pairwise(maps)), start=1)
    ]
    limit = believed_change(max(max(jump[1:]) for jump in found), float(pores.sum()))
    return [jump for jump in found if _beyond_pumps(jump, times, schedule) > limit]


def misplaced_maps(
    times: Sequence[float], maps: Iterable[FloatArray], rates: Schedule | None
) -> list[int]:
    """Return the numbers of the maps that are out of place in time; none if many seem to be.

    The first and last map are not judged. Nor are maps at a change of the rates, and maps while all
    pumps rest: their noise is all that changes.

    Args:
        times: times of the maps [s].
        maps: the maps (nz, nx) [-], in this order.
        rates: rates of the pumps; None if they are not known.
    """
    ratios = np.array(list(_ratios(maps)))
    if not len(ratios):
        return []
    limits = np.maximum(LEAST_RATIO, LEAST_OUTLIER * median_filter(ratios, NEARBY, mode='nearest'))
    odd = [
        number
        for number, (ratio, limit) in enumerate(zip(ratios, limits, strict=True), start=1)
        if ratio > limit and _flows_evenly(rates, times[number - 1], times[number + 1])
    ]
    return odd if len(odd) <= MOST_MISPLACED else []


def _flows_evenly(rates: Schedule | None, start: float, end: float) -> bool:
    """Return whether some pump runs, and none changes, from `start` to `end` [s], if known."""
    if rates is None:
        return True
    changes = any(start < row.time < end for row in rates.rows)
    return not changes and any(rate.rate for rate in rates.at(start).values())


def _ratios(maps: Iterable[FloatArray]) -> Iterator[float]:
    """Yield r(k) of every map between the first and the last; 0 where nothing moves."""
    for (before, frame), (_, after) in pairwise(pairwise(maps)):
        yield _norm(frame - 0.5 * (before + after)) / max(_norm(after - before), SMALLEST_DIVISOR)


def _norm(values: FloatArray) -> float:
    return float(np.sqrt(np.nansum(np.square(values, dtype=np.float64))))


def _held(maps: Sequence[FloatArray], pores: FloatArray) -> Iterator[float]:
    """Yield the tracer of maps [m^3] in the cells that all of them know."""
    known = np.isfinite(maps).all(axis=0)
    for values in maps:
        yield float((values[known] * pores[known]).sum())


def _beyond_pumps(jump: Jump, times: Sequence[float], schedule: Schedule) -> float:
    """Return the part of a jump that the pumps cannot do [m^3], of its smaller side."""
    start, middle, end = times[jump.number - 1 : jump.number + 2]
    rise, fall = jump.held - jump.before, jump.held - jump.after
    brought, taken = _moved(schedule, start, middle)
    brought_after, taken_after = _moved(schedule, middle, end)
    if rise > 0 and fall > 0:
        return min(rise - brought, fall - taken_after)
    return min(-rise - taken, -fall - brought_after)


def _moved(schedule: Schedule, start: float, end: float) -> tuple[float, float]:
    """Return the most tracer [m^3] that pumps bring in and take out from `start` to `end` [s]."""
    spans = [
        (high - low, well)
        for low, high, rates in schedule.intervals(start, end)
        for well in rates.values()
    ]
    fluid = sum(time * max(well.rate, 0.0) for time, well in spans)
    produced = sum(time * max(-well.rate, 0.0) for time, well in spans)
    return SCALE * schedule.injected_stock(start, end), SCALE * max(fluid, produced)


CHECK = Check(needs=('maps',), find=_find, explained_by=('no_values', 'no_stock'))
