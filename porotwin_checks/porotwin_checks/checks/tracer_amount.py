"""Do maps and pumps agree? The tracer in the maps is the tracer that the pumps injected.

Tracer may leave through wells and open sides, at an unknown concentration. Therefore less tracer is
told only while none is near a way out. A prediction knows the tracer that left, so that
`amount_remark` compares both ways.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from porotwin_checks.known import Known, Maps, stock_in_map
from porotwin_checks.near_wells import ways_out
from porotwin_checks.start import Start, start_of
from porotwin_checks.tracer_errors import believed_change, contradict
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rates.wells import Schedule

LEAST_SEEN = 0.95
"""Share of the cells that a map must show: hidden tracer would count as lost [-]."""

FEWEST_MAPS = 5
"""Maps that show a course: a median of neighbours leaves out a single wrong one."""

INVERTED_LEVEL = 0.5
"""Largest median of a first map [-] whose values are those of tracer."""

AMOUNT = '{map} holds {held_ml:.3g} ml of tracer, and by the pumps it would be {pumped_ml:.3g} ml'
REMEDY = (
    '; {pumps}check first whether calibration and baseline are of this rig, then the rates and '
    'clocks, then rig.yaml'
)
PUMPS = 'does the pump of {wells} deliver {change} than its rate? Else '

FLUSHED = '; if the rig was flushed before, begin the rates after that'
INVERTED = '; if 1 is water in these maps, write 1 minus their values'
LATE = 'the clock of the camera is late, or the rig held tracer before the recording: '
REVERSED = 'in reversed order the maps hold the injected tracer; correct their order or their times'
EARLIER = (
    'the first map, at {time_s:g} s, holds tracer from before the recording, with which the model '
    'starts; if the rig was clean then, compare the clocks of camera and pumps'
)
NONE_SEEN = (
    '{empty} of {maps} maps show no tracer, but stock is injected from {begin_s:g} s on; compare '
    'the clocks of camera and pumps'
)
GAIN = (
    'from {begin_s:.0f} to {end_s:.0f} s the maps gain {ml:.3g} ml of tracer more than the pumps '
    'injected; does dirt or light make the sand darker, or does a pump deliver more than its rate?'
)
LOSS = (
    'from {begin_s:.0f} to {end_s:.0f} s the maps lose {ml:.3g} ml of the injected tracer, though '
    'none is near a way out; does the glass fog, does the tracer fade or leak, or does a pump '
    'deliver less than its rate?'
)


def amount_remark(
    held: float, pumped: float, pores: float, name: str, rates: Schedule
) -> Remark | None:
    """Return the remark that a map holds another volume than the pumps can have left; None if not.

    Args:
        held: stock in the map [m^3].
        pumped: stock that would be there by the pumps [m^3].
        pores: the pores of the rig [m^3].
        name: of the map, in words.
        rates: the pumped rates; their wells with tracer are named.
    """
    if not contradict(held, pumped, pores):
        return None
    code = 'too_much_tracer' if held > pumped else 'too_little_tracer'
    return Remark.of('maps', code, AMOUNT + REMEDY, **_facts(held, pumped, name, rates))


def _facts(held: float, pumped: float, name: str, rates: Schedule) -> dict[str, Any]:
    change = 'more' if held > pumped else 'less'
    wells = ' or '.join(tracer_wells(rates))
    pumps = PUMPS.format(wells=wells, change=change) if wells else ''
    volumes = {'map': name, 'held_ml': held * ML, 'pumped_ml': pumped * ML}
    return {**volumes, 'pumps': pumps, 'wells': wells}


def tracer_wells(rates: Schedule) -> list[str]:
    """Return the wells that inject tracer, in the order of their first rows."""
    found = [row.well for row in rates.rows if row.rate.rate > 0.0 and row.rate.concentration > 0.0]
    return [*dict.fromkeys(found)]


class _Course(NamedTuple):
    """The maps in time (nt,): held and injected stock [m^3], and signs of tracer.

    known: some cell is known; whole: nearly all are; visible: some cell shows tracer; leaving: one
    near a way out does.
    """

    held: FloatArray
    injected: FloatArray
    known: NDArray[np.bool_]
    whole: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    leaving: NDArray[np.bool_]


def _course(known: Known, maps: Maps, rates: Schedule) -> _Course:
    exits = ways_out(known.rig, rates, known.grid)
    rows = []
    for time, values in zip(known.times, maps, strict=True):
        seen, visible = np.isfinite(values).mean(), values > PLUME_THRESHOLD
        held = stock_in_map(values, known.rig)
        injected = rates.injected_stock(-np.inf, float(time))
        shown = (seen > 0.0, seen >= LEAST_SEEN, visible.any(), visible[exits].any())
        rows.append((held, injected, *shown))
    return _Course(*(np.array(column) for column in zip(*rows, strict=True)))


def _find(known: Known) -> Iterator[Remark]:
    """Yield the plainest contradiction: it explains the others."""
    maps, rates = known.scaled_maps, known.rates
    assert maps is not None and rates is not None
    course, pores = _course(known, maps, rates), known.rig.pore_volume
    for number, (held, injected) in enumerate(zip(course.held, course.injected, strict=True)):
        told = amount_remark(held, injected, pores, known.name_of(number), rates)
        if told is None:
            continue
        if held > injected:
            yield from _early(known, rates, course) if number == 0 else [told]
            return
        if number == 0 and course.whole[0] and not course.leaving[0]:
            yield Remark.of('maps', told.code, AMOUNT + FLUSHED, **told.facts)
            return
    yield from _none_seen(known, rates, course) or _drift(known, course, pores)


def _early(known: Known, rates: Schedule, course: _Course) -> Iterator[Remark]:
    """Yield the remark about a first map with more tracer than was injected before it."""
    assert known.maps is not None
    first = float(known.times[0])
    facts = _facts(course.held[0], course.injected[0], known.name_of(0), rates)
    facts['time_s'] = first
    if np.nanmedian(known.maps[0]) > INVERTED_LEVEL:
        yield Remark.of('maps', 'inverted_maps', AMOUNT + INVERTED, **facts)
    elif _are_reversed(known, rates, course):
        yield Remark.of('maps', 'reversed_maps', REVERSED, **facts)
    elif start_of(known) is not Start.USED:
        yield Remark.of('maps', 'late_or_used', LATE + AMOUNT + REMEDY, **facts)
    elif rates.injected_stock(first, float(known.times[-1])) > 0.0:
        yield Remark.of('maps', 'earlier_tracer', EARLIER, **facts)


def _are_reversed(known: Known, rates: Schedule, course: _Course) -> bool:
    """Return whether the maps hold the injected tracer if the last one comes first."""
    times = known.times[0] + known.times[-1] - np.asarray(known.times)[::-1]
    held = course.held[::-1]
    injected = np.array([rates.injected_stock(-np.inf, float(time)) for time in times])
    largest = max(held.max(), injected.max())
    wrong = believed_change(largest, known.rig.pore_volume)
    grown = injected[-1] - injected[0] > largest - wrong
    return bool(grown and np.abs(held - injected).max() < wrong)


def _none_seen(known: Known, rates: Schedule, course: _Course) -> list[Remark]:
    """Return the remark that most maps show no tracer while stock is injected."""
    stock = [row.time for row in rates.rows if row.rate.rate > 0 and row.rate.concentration > 0]
    later = course.known & (np.asarray(known.times) > min(stock, default=np.inf))
    empty = int((later & ~course.visible).sum())
    if 2 * empty <= later.sum():
        return []
    counts = {'empty': empty, 'maps': int(later.sum()), 'begin_s': stock[0]}
    return [Remark.of('maps', 'no_tracer', NONE_SEEN, **counts)]


def _drift(known: Known, course: _Course, pores: float) -> Iterator[Remark]:
    """Yield the remark that the excess over the injected tracer grows, or falls.

    A wrong size, a haze over all photographs or a faint background keep the excess constant.
    """
    kept = np.flatnonzero(course.whole)
    if len(kept) < FEWEST_MAPS:
        return
    injected = course.injected[kept]
    # medians of neighbours, so that one wrong photograph does not count
    excess = median_filter(course.held[kept] - injected, 3, mode='nearest')
    for sign, code, words in ((1.0, 'gained_tracer', GAIN), (-1.0, 'lost_tracer', LOSS)):
        first, last = _largest_rise(sign * excess)
        change = sign * (excess[last] - excess[first])
        may_leave = sign < 0.0 and course.leaving[kept].any()
        if change > believed_change(injected[-1], pores) and not may_leave:
            begin, end = (float(known.times[kept[one]]) for one in (first, last))
            yield Remark.of('maps', code, words, begin_s=begin, end_s=end, ml=change * ML)
            return


def _largest_rise(values: FloatArray) -> tuple[int, int]:
    """Return the numbers of the two values, in their order, between which the rise is largest."""
    rise = values - np.minimum.accumulate(values)
    last = int(np.argmax(rise))
    return int(np.argmin(values[: last + 1])), last


CHECK = Check(
    needs=('scaled_maps', 'rates'),
    find=_find,
    explained_by=('no_values', 'no_stock', 'repeated_maps', 'late_baseline'),
)
