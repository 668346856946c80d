"""Do the clocks of pumps, camera and maps agree, and do all count seconds?"""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import CONVERTED
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import HOUR_S, MINUTE_S

FAR_END, FAR_UNITS = (0.55, 1.8), ('hours', 'milliseconds')
"""A ratio like `CONVERTED` for units so far from a second that no end by itself comes near."""

TIME_UNITS = {'minutes': MINUTE_S, 'hours': HOUR_S, 'milliseconds': 1e-3}
"""Units that times may be written in by mistake [s]."""

LATE_BEGIN = 0.5
"""Begin over end of maps above which they are late as a whole: no other unit explains that."""

LEAST_STEPS, REGULAR_SHARE, SAME_STEP = 6, 0.8, 0.1
"""Least number of intervals, the share of them that must be alike, and how much, for a camera that
counts as regular."""

LONG_STEP = 10.0
"""Interval over the usual one above which the camera stood, or its clock was set."""

COMPARE = 'compare the clocks of camera and pumps'


def _find(known: Known) -> Iterator[Remark]:
    yield from _units(known)
    yield from _interval(known)
    yield from _beside_the_pumps(known)


def _units(known: Known) -> Iterator[Remark]:
    """Yield a remark if the rates end where maps and photographs do, but in another unit."""
    seen = [float(known.times[one]) for one in (0, -1) if known.has('times')]
    seen += [photo.time for photo in known.photos if photo.role == 'state']
    if not seen or known.commanded is None:
        return
    end, last = max(seen), known.commanded.rows[-1].time
    if min(seen) > LATE_BEGIN * end:
        return  # another unit would move the begin, too
    for one, other, what, key in (
        (last, end, 'the maps and photographs', 'rates.csv'),
        (end, last, 'the rates', 'concentration.nc or imaging.csv'),
    ):
        for unit, seconds in TIME_UNITS.items():
            low, high = FAR_END if unit in FAR_UNITS else CONVERTED
            if one > 0 and low * other < one * seconds < high * other:
                why = f'its times end at {one:g} s, {what} at {other:g} s'
                yield Remark(
                    key, '', why, f'were its times in {unit}? write seconds', code='time_unit'
                )


def _interval(known: Known) -> Iterator[Remark]:
    """Yield a remark if one interval of a regular camera is odd: its clock may have been set.

    A lost photograph makes an interval of twice the usual one, and is no oddity.
    """
    states = [photo.time for photo in known.photos if photo.role == 'state']
    seen = list(known.times)
    for times, name in ((states, 'imaging.csv'), (seen, 'concentration.nc')):
        steps = np.diff(times)
        if len(steps) < LEAST_STEPS:
            continue
        usual = float(np.median(steps))
        regular = np.abs(steps - usual) < SAME_STEP * usual
        if usual <= 0.0 or regular.mean() < REGULAR_SHARE:
            continue
        lost = np.round(steps / usual)
        odd = (np.abs(steps / usual - lost) > SAME_STEP) & (steps > 1.5 * usual)
        odd |= steps > LONG_STEP * usual
        if odd.any():
            first = int(np.argmax(odd))
            key = f'{name} at {times[first]:g} s'
            why = f'{steps[first]:g} s pass to the next one, and {usual:g} s elsewhere'
            remedy = 'was the clock of the camera set, or did the camera stand?'
            yield Remark(key, '', why, remedy, code='odd_interval')
            return


def _beside_the_pumps(known: Known) -> Iterator[Remark]:
    """Yield remarks if photographs or maps do not fit the times of the pumps."""
    rows = () if known.commanded is None else known.commanded.rows
    pumping = [row.time for row in rows if row.rate.rate]
    if known.commanded is None or not pumping:
        return
    begin, end = pumping[0], rows[-1].time
    tracer = [row.time for row in rows if row.rate.rate > 0 and row.rate.concentration > 0]
    baselines = [photo.time for photo in known.photos if photo.role == 'baseline']
    if tracer and baselines and max(baselines) > tracer[0]:
        why = f'a baseline is of {max(baselines):g} s, but tracer is injected from {tracer[0]:g} s'
        yield Remark('imaging.csv', '', why, f'{COMPARE}, and the roles', code='late_baseline')
    stand = not any(rate.rate for rate in known.commanded.at(end).values())
    states = [photo.time for photo in known.photos if photo.role == 'state']
    for seen, key in ((states, 'imaging.csv'), (list(known.times), 'concentration.nc')):
        if not seen:
            continue
        first, last = min(seen), max(seen)
        last_rate = end if stand else LONG_STEP * max(end, last - first)
        if np.median(seen) < begin or first > last_rate:
            yield Remark.of(
                key,
                'other_times',
                'it is from {first_s:.0f} to {last_s:.0f} s, and the rates are from {begin_s:g} to '
                '{end_s:g} s; ' + COMPARE,
                first_s=first,
                last_s=last,
                begin_s=begin,
                end_s=end,
            )


CHECK = Check(find=_find)
