"""Looks for oddities in a recording: rates, times and photographs that do not fit together."""

import itertools
import math
from collections.abc import Iterable, Iterator

import numpy as np

from porotwin_core.basis.plausibility import Remark
from porotwin_core.basis.units import HOUR_S, MINUTE_S, to_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.rates import later_commands, remarks_about_rates
from porotwin_recording.tables.recorded_data import RecordedData

SAME_END = (0.7, 1.3)
"""Ratio of two ends of a recording, one of them converted, that shows a mistaken unit."""

FAR_END, FAR_UNITS = (0.55, 1.8), ('hours', 'milliseconds')
"""The same ratio for units so far from a second that no end by itself comes near."""

TIME_UNITS = {'minutes': MINUTE_S, 'hours': HOUR_S, 'milliseconds': 1e-3}
"""Units that times may be written in by mistake [s]."""

MOST_EARLY = 0.5
"""Least share of photographs before the start of the pumps for a remark about both clocks."""

LATE_BEGIN = 0.5
"""Begin over end of maps above which they are late as a whole: no other unit explains that."""

MOST_RATIO = 3.0
"""Measured over commanded rates that is odd: worn pumps deliver half of what they should."""

LEAST_STEPS, REGULAR_SHARE, SAME_STEP = 6, 0.8, 0.1
"""Least number of intervals, the share of them that must be alike, and how much, for a camera that
counts as regular."""

LONG_STEP = 10.0
"""Interval over the usual one above which the camera stood, or its clock was set."""

FEW_CELLS = 1e-3
"""Share of the cells of maps that are single ones."""

MOST_PERCENT = 130.0
"""Value above which a map is not in percent."""

SEEN = 0.02
"""Concentration that is tracer and no noise."""

FAINT, LEAST_PLUME_CELLS = 0.4, 50.0
"""Concentration over the injected one below which maps are odd, and the volume of the injected
stock [cells] from which on the plume is larger than its fronts."""

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
    yield from _sum_of_rates(data)
    yield from _idle_producer(data)
    yield from _end(data)
    yield from _photographs(data)
    yield from remarks_about_measured_rates(data)
    yield from remarks_about_times(data)


def remarks_about_times(data: RecordedData) -> Iterator[Remark]:
    """Yield the remarks about times that do not fit to those of the pumps."""
    yield from _times(data)
    yield from _odd_interval(data)
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
        remedy = 'scale the maps'
        if largest > MOST_PERCENT:
            remedy = 'are these grey values of pictures? Make maps with image, or scale them'
        elif largest > 10:
            remedy = 'was this in percent? 1 is the tracer stock'
        if np.nanmean(values > MOST_STOCK) < FEW_CELLS:
            remedy = 'single cells, such as a glare: write NaN there'
        yield Remark('concentration.nc', f'up to {largest:.3g}', '0 is water, 1 is stock', remedy)
    elif largest > SEEN:
        yield from _faint(data, data.maps, largest)


def _faint(data: RecordedData, maps: ConcentrationMaps, largest: float) -> Iterator[Remark]:
    """Yield a remark if a plume of many cells holds far paler water than the pumps inject."""
    if data.commanded is None or not data.commanded.rows:
        return
    rows = [row.rate for row in data.commanded.rows if row.rate.rate > 0.0]
    injected = max((rate.concentration for rate in rows), default=0.0)
    stock = data.commanded.injected_stock(0.0, float(maps.times[-1]))
    cell = float(np.mean(data.rig.cell_pore_volume(maps.grid)))
    if stock < LEAST_PLUME_CELLS * cell * injected or largest >= FAINT * injected:
        return
    remedy = 'is 1 the stock? Import them with --stock, or scale them'
    why = f'the pumps inject {injected:g}, and a plume this large is nearly as strong at its well'
    yield Remark('concentration.nc', f'up to {largest:.3g}', why, remedy)


SAME_RATE = 0.005
"""Relative difference of a rate from the described one that rounding of units makes."""


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
        same = fixed is not None and math.isclose(rate_ml_h, fixed.rate_ml_h, rel_tol=SAME_RATE)
        chase = fixed is not None and row.rate.concentration != fixed.concentration
        if fixed is not None and rate_ml_h and not (same or chase):
            why = f'control.fixed says {fixed.rate_ml_h:g} ml/h'
        elif row.well in control.wells and rate_ml_h > control.max_rate_ml_h:
            why = f'control.max_rate_ml_h is {control.max_rate_ml_h:g} ml/h'
        else:
            continue
        seen.add(row.well)
        yield Remark(where, f'{rate_ml_h:g} ml/h', why, remedy)


def _sum_of_rates(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark for the first time at which the control wells inject too much together.

    A control well that injects tracer is not used as one.
    """
    control = data.rig.control
    if control is None or data.commanded is None:
        return
    most = control.max_total_rate_ml_h
    for time in dict.fromkeys(row.time for row in data.commanded.rows):
        rates = data.commanded.at(time)
        water = [rates[well] for well in control.wells if well in rates]
        total = math.fsum(to_ml_h(rate.rate) for rate in water if rate.concentration == 0.0)
        if total > (1.0 + SAME_RATE) * most:
            yield Remark(
                f'rates.csv at {time:g} s: sum of the control wells',
                f'{total:g} ml/h',
                f'control.max_total_rate_ml_h is {most:g} ml/h',
                'compare rates.csv with the control section of rig.yaml',
            )
            return


def _idle_producer(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if wells inject, and no row tells what the producer takes out."""
    control = data.rig.control
    if control is None or control.producer is None or data.commanded is None:
        return
    rows = data.commanded.rows + (data.measured.rows if data.measured else ())
    injects = any(row.rate.rate > 0.0 for row in rows)
    if injects and all(row.well != control.producer for row in rows):
        why = (
            f"no row is of control.producer '{control.producer}', so that it counts as standing "
            'still while other wells inject'
        )
        yield Remark('rates.csv', '', why, 'add its rates, with a minus, or a row of 0 at 0 s')


def _end(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if nothing says how long the experiment lasts."""
    if data.commanded is None or data.maps is not None or data.photos:
        return
    last = max((row.time for row in data.commanded.rows), default=0.0)
    pumping = sorted(well for well, rate in data.commanded.at(last).items() if rate.rate)
    if last <= 0.0 or pumping:
        why = f'at its last rows {quoted(pumping)} pump, and nothing says until when'
        if last <= 0.0:
            why = 'all its rows are at the start, so that nothing says when the experiment ends'
        yield Remark('rates.csv', '', why, 'end with rows of rate 0 at the last time')


def remarks_about_measured_rates(data: RecordedData) -> Iterator[Remark]:
    """Yield the remarks about measured rates that are incomplete or far from commanded ones."""
    if data.commanded is None or data.measured is None or not data.measured.rows:
        return
    name, rows = 'rates_measured.csv', data.measured.rows
    measured, end = {row.well for row in rows}, rows[-1].time
    missing = sorted(
        {row.well for row in data.commanded.rows if row.rate.rate and row.well not in measured}
    )
    if missing:
        yield Remark(name, '', _unmeasured(missing), 'the commanded rates count there')
    later = [row for row in later_commands(data.commanded, data.measured) if row.well in measured]
    if later:
        changed = f"well '{later[0].well}' at {later[0].time:g} s"
        why = f'it ends at {end:g} s, and rates.csv changes {changed}'
        yield Remark(name, '', why, 'add the later lines; until then the commanded rates count')
    stopped = data.commanded.rows[-1].time
    goes_on = any(rate.rate for rate in data.commanded.at(stopped).values())
    if rows[0].time > max(stopped, 0.0) and not goes_on:
        why = f'it begins at {rows[0].time:g} s, after the last row of rates.csv at {stopped:g} s'
        yield Remark(name, '', why, 'compare the dates and clocks of both')
    yield from _other_fluid(data.commanded, data.measured, name)
    ratios_of_wells = list(_ratios(data.commanded, data.measured))
    turned = _turned(ratios_of_wells)
    if turned:
        why = f'the rates of {quoted(turned)} have the other sign in rates.csv'
        yield Remark(name, '', why, 'write produced water with a minus in both')
    ratios = [abs(ratio) for _, ratio in ratios_of_wells]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not 1.0 / MOST_RATIO < ratio < MOST_RATIO:
        per_minute = SAME_END[0] < ratio * MINUTE_S < SAME_END[1]
        unit = 'were they in ml/min? write ml/h' if per_minute else 'compare both files'
        yield Remark(name, '', f'its rates are {ratio:.3g} times those of rates.csv', unit)


def quoted(wells: Iterable[str]) -> str:
    """Return names of wells in words: 'left' and 'right'."""
    return ' and '.join(f"'{well}'" for well in wells)


def _unmeasured(wells: list[str]) -> str:
    """Say that `wells` pump and have no measured rates."""
    if len(wells) > 1:
        return f'wells {quoted(wells)} pump by rates.csv, but have no measured rates'
    return f'well {quoted(wells)} pumps by rates.csv, but has no measured rates'


def _other_fluid(commanded: Schedule, measured: Schedule, name: str) -> Iterator[Remark]:
    """Yield a remark for the first well that injects another fluid than commanded."""
    asked: dict[str, WellRate] = {}
    found: dict[str, WellRate] = {}
    rows = [(row.time, 0, row) for row in commanded.rows if row.time < measured.rows[-1].time]
    rows += [(row.time, 1, row) for row in measured.rows]
    both = itertools.groupby(sorted(rows, key=lambda item: item[:2]), key=lambda item: item[0])
    for time, changes in both:
        for _, is_measured, row in changes:
            (found if is_measured else asked)[row.well] = row.rate
        for well, rate in found.items():
            own = asked.get(well, WellRate())
            if min(rate.rate, own.rate) > 0.0 and own.concentration != rate.concentration:
                yield Remark(
                    f"{name}: concentration of well '{well}' at {time:g} s",
                    f'{rate.concentration:g}',
                    f'rates.csv says {own.concentration:g}',
                    'write the injected one; a change of the fluid needs its own row',
                )
                return


def wells_with_turned_sign(commanded: Schedule, measured: Schedule) -> list[str]:
    """Return the wells, sorted, whose measured rates have the other sign than the commanded ones.

    Half of the measured rows of a well or more must have it: one may belong to a reversed pump.
    """
    return _turned(_ratios(commanded, measured))


def _turned(ratios: Iterable[tuple[str, float]]) -> list[str]:
    signs: dict[str, list[bool]] = {}
    for well, ratio in ratios:
        signs.setdefault(well, []).append(ratio < 0.0)
    return sorted(well for well, turned in signs.items() if 2 * sum(turned) >= len(turned))


def _ratios(commanded: Schedule, measured: Schedule) -> Iterator[tuple[str, float]]:
    """Yield wells with measured over commanded rates, at the rows of wells that shall pump."""
    for row in measured.rows:
        asked = commanded.at(row.time).get(row.well)
        if asked is not None and asked.rate and row.rate.rate:
            yield row.well, row.rate.rate / asked.rate


def _odd_interval(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if one interval of a regular camera is odd: its clock may have been set.

    A lost photograph makes an interval of twice the usual one, and is no oddity.
    """
    states = [photo.time for photo in data.photos if photo.role == 'state']
    seen = [] if data.maps is None else data.maps.times.tolist()
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
            yield Remark(key, '', why, 'was the clock of the camera set, or did the camera stand?')
            return


def _times(data: RecordedData) -> Iterator[Remark]:
    seen = [] if data.maps is None else data.maps.times[[0, -1]].tolist()
    seen += [photo.time for photo in data.photos if photo.role == 'state']
    if not seen or data.commanded is None:
        return
    end, last = max(seen), data.commanded.rows[-1].time
    if min(seen) > LATE_BEGIN * end:
        return  # another unit would move the begin, too
    for one, other, what, key in (
        (last, end, 'the maps and photographs', 'rates.csv'),
        (end, last, 'the rates', 'concentration.nc or imaging.csv'),
    ):
        for unit, seconds in TIME_UNITS.items():
            low, high = FAR_END if unit in FAR_UNITS else SAME_END
            if one > 0 and low * other < one * seconds < high * other:
                why = f'its times end at {one:g} s, {what} at {other:g} s'
                yield Remark(key, '', why, f'were its times in {unit}? write seconds')


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
        why = (
            f'a baseline is of {late[0]:g} s, but rates.csv injects tracer from {tracer[0]:g} s on'
        )
        yield Remark('imaging.csv', '', why, 'compare both clocks, and the roles')
    seen = [photo.time for photo in data.photos if photo.role == 'state']
    begin, end = pumping[0], rows[-1].time
    stand = not any(rate.rate for rate in data.commanded.at(end).values())
    early = np.mean(np.array(seen) < begin) > MOST_EARLY if seen else False
    if seen and (early or (stand and min(seen) > end)):
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
    states = [photo for photo in data.photos if photo.role == 'state']
    same = [pair for pair in itertools.pairwise(states) if pair[0].time == pair[1].time]
    if same:
        first, second = same[0]
        why = f'{first.name} and {second.name} have the same time of {first.time:g} s'
        remedy = 'correct one time'
        if len(same) > 1:
            why += f', and {len(same) - 1} more pairs likewise'
        if all(photo.time % MINUTE_S == states[0].time % MINUTE_S for photo in states):
            remedy = 'a table program may have dropped the seconds; write them again'
        yield Remark('imaging.csv', '', why, remedy)


def _maps_beside_the_pumps(data: RecordedData) -> Iterator[Remark]:
    """Yield a remark if the pumps ran at no time of a map."""
    if data.commanded is None or data.maps is None or not len(data.maps.times):
        return
    rows = data.commanded.rows
    pumping = [row.time for row in rows if row.rate.rate]
    begin, end = float(data.maps.times[0]), rows[-1].time
    stand = not any(rate.rate for rate in data.commanded.at(end).values())
    if not pumping:
        return
    if not stand and begin > LONG_STEP * max(end, float(data.maps.times[-1]) - begin):
        why = f'the first map is of {begin:g} s, the last line of rates.csv of {end:g} s'
    elif not stand:
        return
    elif begin > end:
        why = f'the first map is of {begin:g} s, the pumps stop at {end:g} s'
    elif float(data.maps.times[-1]) < pumping[0]:
        why = f'the last map is of {data.maps.times[-1]:g} s, the pumps start at {pumping[0]:g} s'
    else:
        return
    yield Remark('concentration.nc', '', why, 'compare the clocks of camera and pumps')
