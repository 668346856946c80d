"""Looks for oddities in a recording: rates, times and photographs that do not fit together."""

import math
from collections.abc import Iterator

import numpy as np

from porotwin_core.plausibility import Remark
from porotwin_core.units import MINUTE_S, to_ml_h
from porotwin_recording.rates import remarks_about_rates
from porotwin_recording.recorded_data import RecordedData

SAME_END = (0.7, 1.3)
"""Ratio of two ends of a recording, one of them converted, that shows a mistaken unit."""

MOST_STOCK = 1.3
"""Concentration above which a map is odd [-]; noise and light lift it above 1, but no further."""


def remarks_about_recording(data: RecordedData) -> Iterator[Remark]:
    """Yield the remarks about a recording. Maps and photographs are not opened."""
    named = set()
    for schedule, name in ((data.commanded, 'rates.csv'), (data.measured, 'rates_measured.csv')):
        if schedule is not None:
            found = remarks_about_rates(schedule, data.rig, name)
            named |= {remark.key for remark in found}
            yield from found
    yield from (remark for remark in _limits(data) if remark.key not in named)
    yield from _end(data)
    yield from _photographs(data)
    yield from remarks_about_times(data)


def remarks_about_times(data: RecordedData) -> Iterator[Remark]:
    """Yield the remarks about times that do not fit to those of the pumps."""
    yield from _times(data)
    yield from _beside_the_pumps(data)
    yield from _maps_beside_the_pumps(data)


def remarks_about_maps(data: RecordedData) -> Iterator[Remark]:
    """Yield the remarks about the values of the first, middle and last map of a recording."""
    if data.maps is None:
        return
    count = len(data.maps)
    values = np.array([data.maps[index] for index in sorted({0, count // 2, count - 1})])
    if not np.isfinite(values).any():
        why = 'every value of the first, middle and last map is missing (NaN)'
        yield Remark('concentration.nc', '', why, 'write the maps again')
        return
    largest = float(np.nanmax(values))
    if largest > MOST_STOCK:
        remedy = 'was this in percent? 1 is the tracer stock' if largest > 10 else 'scale the maps'
        yield Remark('concentration.nc', f'up to {largest:.3g}', '0 is water, 1 is stock', remedy)


def _limits(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark for each well whose commanded rate the control section does not allow."""
    control = data.rig.control
    if control is None or data.commanded is None:
        return
    seen: set[str] = set()
    for row in data.commanded.rows:
        if row.well in seen:
            continue
        rate_ml_h = to_ml_h(row.rate.rate)
        where = f'rates.csv: well {row.well}'
        remedy = 'compare rates.csv with the control section of rig.yaml'
        fixed = control.fixed.get(row.well)
        if fixed is not None and rate_ml_h and not math.isclose(rate_ml_h, fixed.rate_ml_h):
            why = f'control.fixed says {fixed.rate_ml_h:g} ml/h'
        elif row.well in control.wells and rate_ml_h > control.max_rate_ml_h:
            why = f'control.max_rate_ml_h is {control.max_rate_ml_h:g} ml/h'
        else:
            continue
        seen.add(row.well)
        yield Remark(where, f'{rate_ml_h:g} ml/h', why, remedy)


def _end(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if nothing says how long the experiment lasts."""
    if data.commanded is None or data.maps is not None or data.photos:
        return
    if max((row.time for row in data.commanded.rows), default=0.0) <= 0.0:
        why = 'all its rows are at the start, so that nothing says when the experiment ends'
        yield Remark('rates.csv', '', why, 'end with rows of rate 0 at the last time')


def _times(data: RecordedData) -> Iterator[Remark]:
    seen = [] if data.maps is None else [float(data.maps.times[-1])]
    seen += [photo.time for photo in data.photos if photo.role == 'state']
    if not seen or data.commanded is None:
        return
    end, last = max(seen), data.commanded.rows[-1].time
    low, high = SAME_END
    for one, other, what, key in (
        (last, end, 'the maps and photographs', 'rates.csv'),
        (end, last, 'the rates', 'concentration.nc or imaging.csv'),
    ):
        if one > 0 and low * other < one * MINUTE_S < high * other:
            why = f'its times end at {one:g} s, {what} at {other:g} s'
            yield Remark(key, '', why, 'were its times in minutes? write seconds')


def _beside_the_pumps(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if the photographs do not fit to the times at which the pumps ran."""
    if data.commanded is None:
        return
    rows = data.commanded.rows
    pumping = [row.time for row in rows if row.rate.rate]
    if not pumping or not data.photos:
        return
    tracer = [row.time for row in rows if row.rate.rate > 0 and row.rate.concentration > 0]
    late = [
        photo.time
        for photo in data.photos
        if photo.role == 'baseline' and tracer and photo.time > tracer[0]
    ]
    if late:
        why = f'rates.csv injects tracer from {tracer[0]:g} s on, before this baseline'
        yield Remark('imaging.csv', f'{late[0]:g} s', why, 'compare both clocks, and the roles')
    seen = [photo.time for photo in data.photos if photo.role == 'state']
    begin, end = pumping[0], rows[-1].time
    stand = not any(rate.rate for rate in data.commanded.at(end).values())
    if seen and (max(seen) < begin or (stand and min(seen) > end)):
        why = (
            f'the photographs are from {min(seen):.0f} to {max(seen):.0f} s, the pumps run from '
            f'{begin:g} to {end:g} s'
        )
        yield Remark('imaging.csv', '', why, 'compare the clocks of camera and pumps')


def _photographs(data: RecordedData) -> Iterator[Remark]:
    if not data.photos:
        return
    names = [photo.name for photo in data.photos]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        yield Remark('imaging.csv', twice[0], 'the photograph stands twice', 'remove one line')
    baselines = [photo.time for photo in data.photos if photo.role == 'baseline']
    if not baselines:
        why = 'no photograph has the role baseline: sand and water only'
        yield Remark('imaging.csv', '', why, 'give the first photograph this role')
    elif max(baselines) > min((p.time for p in data.photos if p.role == 'state'), default=np.inf):
        why = 'a baseline comes after a photograph with tracer'
        yield Remark('imaging.csv', f'{max(baselines):g} s', why, 'compare times and roles')
    times = [photo.time for photo in data.photos if photo.role == 'state']
    if len(set(times)) < len(times):
        yield Remark('imaging.csv', '', 'two photographs have the same time', 'correct one time')


def _maps_beside_the_pumps(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if no map is of the time at which the pumps ran."""
    if data.commanded is None or data.maps is None or not len(data.maps.times):
        return
    rows = data.commanded.rows
    pumping = [row.time for row in rows if row.rate.rate]
    begin, end = float(data.maps.times[0]), rows[-1].time
    stand = not any(rate.rate for rate in data.commanded.at(end).values())
    if not pumping or not stand:
        return
    if begin > end:
        why = f'the first map is of {begin:g} s, the pumps stop at {end:g} s'
    elif float(data.maps.times[-1]) < pumping[0]:
        why = f'the last map is of {data.maps.times[-1]:g} s, the pumps start at {pumping[0]:g} s'
    else:
        return
    yield Remark('concentration.nc', '', why, 'compare the clocks of camera and pumps')
