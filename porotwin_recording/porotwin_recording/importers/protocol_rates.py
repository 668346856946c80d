"""The rates of `injection_protocol.csv` and `measured_protocol.csv`, in any unit."""

import bisect
import itertools
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np

from porotwin_checks.checks.measured_rates import wells_with_turned_sign
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import as_known
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate, quoted
from porotwin_core.rig import Rig
from porotwin_recording.importers.foreign_table import (
    ForeignTable,
    bare_title,
    number_in,
    read_foreign_table,
)
from porotwin_recording.importers.foreign_time import names_zone
from porotwin_recording.importers.foreign_units import (
    check_density,
    density_factor,
    rate_factor,
    share_factor,
    unit_in,
)
from porotwin_recording.importers.open_question import QuestionError
from porotwin_recording.importers.protocol_answers import (
    INJECTION_PROTOCOL,
    MEASURED_PROTOCOL,
    ProtocolAnswers,
    dated_words,
    protocol_moments,
)
from porotwin_recording.importers.twelve_hours import (
    may_be_of_twelve_hours,
    rates_on_twelve_hours,
)
from porotwin_recording.importers.words_of_languages import NAMES, plain

NEAR_M = 0.02
"""Longest distance from a location to the well that is meant [m]: a hand's measurement."""


NO_SHARE = 'write a number, or a negative rate if this well takes water out'
"""Remedy for an injection without a concentration."""

START = ('start', 'datetime', 'time', 'date')
"""Quantities of the column of starts, the surest first."""


@dataclass(frozen=True)
class PumpedRate:
    """A rate [m^3/s] of a well from `start` to `end`; None: until the end of the recording."""

    start: datetime
    end: datetime | None
    well: str
    rate: WellRate


def pumped_rates(
    path: Path,
    rig: Rig,
    answers: ProtocolAnswers,
    told: list[str],
    commanded: list[PumpedRate] | None = None,
) -> list[PumpedRate]:
    """Return the rates of a protocol in the order of their times.

    Without a column of concentrations, the `commanded` rates of the same well tell them.
    """
    table = read_foreign_table(path, answers.decimal)
    starts = protocol_moments(table, table.needed(*START), answers, told)
    wells = _wells(table, rig, told)
    ends = _ends(table, starts, wells, answers, told)
    if answers.clock:
        starts, ends = rates_on_twelve_hours(path, starts, ends, answers.clock)
        told.append(f'{path}: times of a 12-hour clock without am and pm')
    rates = _rates(table, rig, answers, told)
    as_commanded = commanded and table.find('concentration') is None
    if as_commanded:
        told.append(f'{path}: no column concentration: {INJECTION_PROTOCOL} tells it')
        shares = [1.0] * table.length
    else:
        shares = _concentrations(table, wells, rates, answers, told)
    rows = []
    for number, start, end, well, rate, share in zip(
        table.lines, starts, ends, wells, rates, shares, strict=True
    ):
        if end is not None and end <= start:
            raise QuestionError(
                f'{path}:{number}: ends at {end:%H:%M}, not after its start at {start:%H:%M}'
                + ', as on a 12-hour clock without am and pm'
                * (twelve := may_be_of_twelve_hours(starts, ends)),
                [{'clock': '12h-am'}, {'clock': '12h-pm'}] * twelve,
                'correct one of both, or write am and pm',
            )
        rows.append(PumpedRate(start, end, well, WellRate(rate, share if rate > 0 else 0.0)))
    rows.sort(key=lambda row: row.start)
    _check_overlap(path, rows)
    if path.name == MEASURED_PROTOCOL:
        told += _gaps(path, rows)
    return with_commanded_shares(rows, commanded) if commanded and as_commanded else rows


def with_commanded_shares(rows: list[PumpedRate], commanded: list[PumpedRate]) -> list[PumpedRate]:
    """Return measured `rows` with the `commanded` concentrations; both are sorted by start.

    A row is split where the commanded concentration of its well changes, up to the last time in
    `rows`: after it the commanded rates count.
    """
    last = max(row.end or row.start for row in rows)
    changes = {well: _changes_of_share(commanded, well) for well in {row.well for row in rows}}
    pieces = [piece for row in rows for piece in _pieces(row, changes[row.well], last)]
    return sorted(pieces, key=lambda row: row.start)


def _pieces(
    row: PumpedRate, changes: list[tuple[datetime, float]], last: datetime
) -> Iterator[PumpedRate]:
    """Yield the parts of `row` between the `changes` of the concentration before `last`."""
    if row.rate.rate <= 0:
        yield row
        return
    begun = [share for start, share in changes if start <= row.start] or [
        changes[0][1] if changes else 1.0
    ]
    inside = [(start, share) for start, share in changes if row.start < start < (row.end or last)]
    starts = [(row.start, begun[-1]), *inside]
    ends = [start for start, _ in inside] + [row.end]
    for (start, share), end in zip(starts, ends, strict=True):
        yield PumpedRate(start, end, row.well, replace(row.rate, concentration=share))


def _changes_of_share(commanded: list[PumpedRate], well: str) -> list[tuple[datetime, float]]:
    """Return the changes of concentration of the injections of `well`: time, new value.

    The first pair is its first injection; there is none if it never injects.
    """
    changes: list[tuple[datetime, float]] = []
    for row in commanded:
        if row.well == well and row.rate.rate > 0:
            share = row.rate.concentration
            if not changes or share != changes[-1][1]:
                changes.append((row.start, share))
    return changes


def _gaps(path: Path, rows: list[PumpedRate]) -> list[str]:
    """Return a line if a log has gaps between the rates of a well, which count as a rest."""
    gaps = [
        (earlier.end, well)
        for well, earlier, later in _successors(rows)
        if earlier.end is not None and earlier.end < later.start and earlier.rate.rate
    ]
    if not gaps:
        return []
    first, well = min(gaps)
    return [
        f'{path}: {len(gaps)} gaps between rates count as a stopped pump, the first at '
        f"{first:%Y-%m-%d %H:%M:%S} (well '{well}'); add rows if the pump ran"
    ]


def _ends(
    table: ForeignTable,
    starts: list[datetime],
    wells: list[str],
    answers: ProtocolAnswers,
    told: list[str],
) -> Sequence[datetime | None]:
    """Return when each rate ends: at the next row of its well if no column says it."""
    title = table.find('end')
    if title is not None:
        start = table.needed(*START)
        zoned = [
            names_zone(dated_words(table, each), answers.date_numbers) for each in (start, title)
        ]
        if zoned[0] != zoned[1] and not answers.time_zone:
            raise InputError(
                f'{table.path}: only one of {table.spelt(start)} and {table.spelt(title)} names a '
                'time zone; give '
                '--time-zone, such as Europe/Oslo, the zone of the times that name none'
            )
        return protocol_moments(table, title, answers, told)
    if (duration := table.find('duration')) is not None:  # the rate would go on behind it
        raise InputError(
            f'{table.path}: {table.spelt(duration)} is not read; add a column end with dates and '
            'times'
        )
    told.append(f'{table.path}: no column end: every rate holds until the next row of its well')
    of_well: dict[str, list[datetime]] = defaultdict(list)
    for begin, well in sorted(zip(starts, wells, strict=True)):
        of_well[well].append(begin)
    ends: list[datetime | None] = []
    for begin, well in zip(starts, wells, strict=True):
        own = of_well[well]
        following = bisect.bisect_right(own, begin)
        ends.append(own[following] if following < len(own) else None)
    return ends


def _check_overlap(path: Path, rows: list[PumpedRate]) -> None:
    """Check that no two rates of one well in `rows`, sorted by start, overlap.

    Raises:
        InputError: two do.
    """
    for well, earlier, later in _successors(rows):
        if later.start == earlier.start or (earlier.end and later.start < earlier.end):
            raise InputError(
                f"{path}: two rates of well '{well}' overlap at "
                f'{later.start:%Y-%m-%d %H:%M:%S}; correct start or end'
            )


def _successors(rows: list[PumpedRate]) -> Iterator[tuple[str, PumpedRate, PumpedRate]]:
    """Yield every well with each two of its `rows`, sorted by start, that follow each other."""
    for well in dict.fromkeys(row.well for row in rows):
        for earlier, later in itertools.pairwise(row for row in rows if row.well == well):
            yield well, earlier, later


def _wells(table: ForeignTable, rig: Rig, told: list[str]) -> list[str]:
    """Return the well of every injection, by its name or by its place."""
    named = table.find('well')
    if named is not None and not any('(' in word for word in table.columns[named]):
        wells = [as_known(word, rig.wells) for word in table.columns[named]]
        for line, word in zip(table.lines, wells, strict=True):
            if word not in rig.wells:
                raise InputError(
                    f"{table.path}:{line}: unknown well '{word}'; the rig has "
                    f'{", ".join(rig.wells)}'
                )
        return wells
    if named is not None:
        words = [re.findall(r'[-+\d.,eE]*\d', word) for word in table.columns[named]]
        if any(len(pair) != 2 for pair in words):
            raise InputError(f'{table.path}: {named} needs two numbers, such as (0.24, 0.23)')
        # no length of a rig has thousands: a comma is a decimal one
        pairs = [[number_in(word.replace('.', ','), 'comma') for word in pair] for pair in words]
        places = [(x, z) for x, z in pairs]
        if not np.isfinite(places).all():
            raise InputError(f'{table.path}: {named} needs two numbers, such as (0.24, 0.23)')
    else:
        if table.find('x') is None:
            raise InputError(
                f'{table.path}: has no column of wells; rename one to well (names of rig.yaml), or '
                f'two to location_x and location_y [m]. Its columns are {table.titles}'
            )
        x, z = table.needed('x'), table.needed('z')
        places = list(zip(table.numbers(x), table.numbers(z), strict=True))
    return [_nearest(place, table, rig, told) for place in places]


def _nearest(place: tuple[float, float], table: ForeignTable, rig: Rig, told: list[str]) -> str:
    """Return the well nearest to a place [m]."""
    distances = {
        name: float(np.hypot(well.x_m - place[0], well.z_m - place[1]))
        for name, well in rig.wells.items()
    }
    name = min(distances, key=lambda each: distances[each])
    at = f'({place[0]:g}, {place[1]:g}) m'
    if distances[name] > NEAR_M:
        raise InputError(
            f'{table.path}: no well of the rig is at {at}; the nearest, {name}, is '
            f'{100 * distances[name]:.1f} cm away: correct the location (m, upward) or rig.yaml'
        )
    line = f"{table.path}: {at} is well '{name}'"
    told += [] if line in told else [line]
    return name


def _rates(table: ForeignTable, rig: Rig, answers: ProtocolAnswers, told: list[str]) -> list[float]:
    """Return the rates [m^3/s]."""
    titles = [title for title in table.columns if bare_title(title) in NAMES['rate']] or [
        title for title in table.columns if plain(title).startswith(NAMES['rate'])
    ]
    if not titles:
        raise InputError(f'{table.path}: has no column of rates; name one rate [ml/min]')
    title = table.only(titles)
    where = f'{table.path}: {table.spelt(title)}'
    unit = answers.rate_unit or unit_in(title)
    if 'sccm' in unit:
        raise InputError(f'{where}: is of a gas at standard conditions; write the rate of a liquid')
    densities = _densities(table, rig)
    told.append(f'{where}: in {unit}{" (--rate-unit)" if answers.rate_unit else ""}')
    return [
        _without_rounding_errors(value * rate_factor(unit, where, density_kg_m3=own))
        for value, own in zip(table.numbers(title), densities, strict=True)
    ]


def _densities(table: ForeignTable, rig: Rig) -> list[float]:
    """Return the density [kg/m^3] of the fluid in every row; the rig tells it without a column."""
    title = table.find('density')
    if title is None:
        return [rig.density_kg_m3] * table.length
    factor = density_factor(unit_in(title), f'{table.path}: {title}')
    return [
        check_density(factor * value, f'{table.path}:{row}: {title}')
        for row, value in zip(table.lines, table.numbers(title), strict=True)
    ]


def _without_rounding_errors(rate: float) -> float:
    """Return a converted rate [m^3/s] that is a short number in ml/h, if it nearly is one."""
    return from_ml_h(float(f'{to_ml_h(rate):.12g}'))


def _concentrations(
    table: ForeignTable,
    wells: list[str],
    rates: list[float],
    answers: ProtocolAnswers,
    told: list[str],
) -> list[float]:
    """Return the concentrations; a row that does not inject needs none.

    Raises:
        InputError: one is no share, or nothing tells which of several wells injects tracer.
    """
    title = table.find('concentration')
    if title is not None:
        factor = share_factor(unit_in(title), f'{table.path}: {title}')
        injects = [rate > 0 for rate in rates]
        found = [factor * value for value in table.numbers(title, injects, remedy=NO_SHARE)]
        for row, share in zip(table.lines, found, strict=True):
            if not 0.0 <= share <= 1.0:
                raise InputError(
                    f'{table.path}:{row}: {title} is {share / factor:g}; write a share of the '
                    'tracer stock from 0 (water) to 1, or percent with % in the title'
                )
        idle = sum(share > 0 and rate < 0 for share, rate in zip(found, rates, strict=True))
        if idle:
            told.append(
                f'{table.path}: {title} is left out where water is taken out ({idle} rows); was '
                'the sign of these rates wrong?'
            )
        return found
    inject = {well for well, rate in zip(wells, rates, strict=True) if rate > 0}
    if answers.concentration is None and len(inject) > 1:
        first, *others = sorted(inject)
        example = ','.join([f'{first}=1', *(f'{well}=0' for well in others)])
        raise InputError(
            f'{table.path}: no column concentration, and {quoted(sorted(inject))} inject; '
            'add the column, 1 for tracer stock and 0 for water, or give --concentration 1 for '
            f'all, or such as {example}'
        )
    if answers.concentration is None:
        told.append(
            f'{table.path}: no column concentration: every injection is taken as tracer stock; '
            '--concentration says otherwise'
        )
    given = 1.0 if answers.concentration is None else answers.concentration
    if isinstance(given, float):
        return [given] * table.length
    if missing := sorted(inject - given.keys()):
        raise InputError(
            f'{table.path}: --concentration names no concentration of {quoted(missing)}; '
            f'add {missing[0]}=1'
        )
    return [given.get(well, 0.0) for well in wells]


def since(begin: datetime, rows: list[PumpedRate], told: list[str]) -> list[PumpedRate]:
    """Return the rates from time zero on: a recording has no earlier ones."""
    early = [row for row in rows if row.start < begin and row.rate.rate]
    if early:
        told.append(
            f'{MEASURED_PROTOCOL}: {len(early)} rates begin before the first of '
            f'{INJECTION_PROTOCOL}; their earlier part is left out. Compare the clocks'
        )
    kept = [row for row in rows if row.end is None or row.end > begin]
    return [replace(row, start=max(row.start, begin)) for row in kept]


def schedule_of(
    rows: list[PumpedRate], begin: datetime, commanded: Schedule | None = None
) -> Schedule:
    """Return the rates over time; a well stops at the end of a rate.

    Args:
        rows: the rates of a log.
        begin: time zero.
        commanded: for a measured log: the commanded rates [m^3/s], which count from the end of the
            whole log on, if its rates have ends.
    """
    found: list[ScheduleRow] = []
    starts = {(row.well, row.start) for row in rows}
    for row in rows:
        found.append(ScheduleRow((row.start - begin).total_seconds(), row.well, row.rate))
        if row.end is not None and (row.well, row.end) not in starts:
            stop = WellRate(0.0, row.rate.concentration)
            found.append(ScheduleRow((row.end - begin).total_seconds(), row.well, stop))
    ends = [row.end for row in rows if row.end is not None]
    if commanded is not None and ends and len(ends) == len(rows):
        end = (max(ends) - begin).total_seconds()
        at_end = {row.well: WellRate() for row in rows} | commanded.at(end)
        found = [row for row in found if row.time < end]
        found += [
            ScheduleRow(end, well, at_end[well]) for well in dict.fromkeys(row.well for row in rows)
        ]
    return Schedule(tuple(sorted(found, key=lambda each: each.time)))


def check_measured(path: Path, commanded: Schedule, measured: Schedule, *, is_over: bool) -> None:
    """Check that measured rates belong to the commanded ones.

    Args:
        path: the log, for messages.
        commanded: commanded rates.
        measured: measured rates from time zero on.
        is_over: whether the log ends before time zero.

    Raises:
        InputError: a well has the other sign, or the log belongs to another time.
    """
    turned = wells_with_turned_sign(commanded, measured)
    if turned:
        raise InputError(
            f'{path}: the rates of {quoted(turned)} have the other sign in '
            f'{INJECTION_PROTOCOL}; write produced water with a minus in both'
        )
    first, last = measured.rows[0].time if measured.rows else 0.0, commanded.rows[-1].time
    if is_over or first > max(last, 0.0):
        raise InputError(
            f'{path}: has no rate in the time of {INJECTION_PROTOCOL}; compare their dates, and '
            'the order of day and month'
        )
