"""Folders with `imaging_protocol.csv` and `injection_protocol.csv`, as DarSIA uses them.

Columns of the imaging: `image_id` or `path`, and `datetime`. Columns of the injection: `location`
(a well), or `location_x` and `location_y` [m]; `start`, `end`, and a rate with its unit, such as
`rate_ml/min`. See https://github.com/pmgbergen/DarSIA. The log of a flow meter or a balance,
`measured_protocol.csv`, has the columns of the injection.
"""

import bisect
import itertools
import os
import re
import shutil
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig
from porotwin_core.units import LONGEST_EXPERIMENT_S, from_ml_h, to_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_recording.clock_order import check_order, counters
from porotwin_recording.csv_table import number_text, write_table
from porotwin_recording.experiment_folder import write_folder
from porotwin_recording.foreign_table import Decimal, ForeignTable, number_in, read_foreign_table
from porotwin_recording.foreign_time import DateOrder, moments, names_zone
from porotwin_recording.foreign_units import (
    check_density,
    density_factor,
    rate_factor,
    share_factor,
    unit_in,
)
from porotwin_recording.odd_recording import wells_with_turned_sign
from porotwin_recording.photos import HEADER, IMAGING_FILE, Photo
from porotwin_recording.recorded_data import RecordedData

IMAGING_PROTOCOL = 'imaging_protocol.csv'
INJECTION_PROTOCOL = 'injection_protocol.csv'
MEASURED_PROTOCOL = 'measured_protocol.csv'
PROTOCOLS = (IMAGING_PROTOCOL, INJECTION_PROTOCOL, MEASURED_PROTOCOL)

IMAGES = ('.jpg', '.jpeg', '.png', '.tif', '.tiff')

MOST_DIGITS = 18
"""Most digits of an image_id; a camera counts to a few thousand."""

NEAR_M = 0.02
"""Longest distance from a location to the well that is meant [m]: a hand's measurement."""


@dataclass(frozen=True)
class ProtocolAnswers:
    """Answers to open questions of protocols; empty or None: as the protocols show.

    Attributes:
        date_order: order of day and month.
        time_zone: zone of times without one, such as Europe/Oslo.
        decimal: decimal point or comma.
        rate_unit: unit of rates, such as ml/min.
        concentration: concentration of injected fluids where no column has it [-].
        camera_ahead_s: time by which the camera's clock is ahead of the pumps' [s].
    """

    date_order: DateOrder | None = None
    time_zone: str = ''
    decimal: Decimal | None = None
    rate_unit: str = ''
    concentration: float | None = None
    camera_ahead_s: float = 0.0


def has_protocols(folder: Path) -> bool:
    """Return whether a folder has one of the protocols."""
    return any((folder / name).is_file() for name in PROTOCOLS)


def import_protocols(folder: Path, target: Path, rig: Rig, answers: ProtocolAnswers) -> list[str]:
    """Write an experiment folder from protocols and photographs; return the assumptions made.

    Time zero is the first commanded injection, else the first measured one, else the first
    photograph. Photographs before time zero are baselines. Photographs are linked where the file
    system allows it.

    Args:
        folder: the folder with the protocols.
        target: the new experiment folder.
        rig: the rig, whose wells the locations mean.
        answers: answers to the questions that the protocols leave open.

    Raises:
        InputError: one line with the file, the fault and the remedy.
    """
    told: list[str] = []
    if not abs(answers.camera_ahead_s) <= LONGEST_EXPERIMENT_S:  # also if it is no number
        raise InputError(
            f'--camera-ahead {answers.camera_ahead_s:g}: give the lead of the clock in seconds, at '
            f'most a year ({LONGEST_EXPERIMENT_S:.0f})'
        )
    there = [name for name in PROTOCOLS if (folder / name).is_file()]
    if not {IMAGING_PROTOCOL, INJECTION_PROTOCOL} & {*there}:
        raise InputError(f'{folder}: has neither {IMAGING_PROTOCOL} nor {INJECTION_PROTOCOL}')
    photographs = _photographs(folder, answers, told) if IMAGING_PROTOCOL in there else []
    commanded = measured = None
    if INJECTION_PROTOCOL in there:
        commanded = _pumped(folder / INJECTION_PROTOCOL, rig, answers, told)
    if MEASURED_PROTOCOL in there:
        measured = _pumped(folder / MEASURED_PROTOCOL, rig, answers, told, commanded)
    _check_clocks([folder / name for name in there], answers)
    pumped = commanded or measured or []
    begin = min([row.start for row in pumped] or [moment for moment, _ in photographs])
    photos = _with_roles(photographs, begin, told)
    asked = _schedule(commanded, begin) if commanded else None
    delivered = _schedule(_since(begin, measured, told), begin) if measured else None
    if asked is not None and delivered is not None:
        last = max(row.end or row.start for row in measured or ())
        _check_measured(folder / MEASURED_PROTOCOL, asked, delivered, is_over=last <= begin)
    write_folder(target, RecordedData(rig, commanded=asked, measured=delivered))
    _place(target, photos)
    for file in target.iterdir():  # the date of a recording is that of its oldest file
        if file.is_file():
            os.utime(file, (begin.timestamp(), begin.timestamp()))
    told.append(f'time zero is {begin:%Y-%m-%d %H:%M:%S}' + (' UTC' * bool(answers.time_zone)))
    return told


def _check_measured(path: Path, commanded: Schedule, measured: Schedule, *, is_over: bool) -> None:
    """Check that measured rates belong to the commanded ones.

    Args:
        path: the log, for messages.
        commanded: commanded rates.
        measured: measured rates from time zero on.
        is_over: whether the log ends before time zero.

    Raises:
        InputError: those of a well have the other sign, or they are of another time.
    """
    turned = sorted(wells_with_turned_sign(commanded, measured))
    if turned:
        raise InputError(
            f'{path}: the rates of {" and ".join(turned)} have the other sign in '
            f'{INJECTION_PROTOCOL}; write produced water with a minus in both'
        )
    first, last = measured.rows[0].time if measured.rows else 0.0, commanded.rows[-1].time
    if is_over or first > max(last, 0.0):
        raise InputError(
            f'{path}: has no rate in the time of {INJECTION_PROTOCOL}; compare their dates, and '
            'the order of day and month'
        )


def _check_clocks(paths: list[Path], answers: ProtocolAnswers) -> None:
    """Check that the times of all protocols can be compared.

    Raises:
        InputError: one names its zone, and nothing says the zone of another.
    """
    if answers.time_zone:
        return
    tables = [read_foreign_table(path, answers.decimal) for path in paths]
    zoned = {
        table.path: any(names_zone(words) for words in table.columns.values()) for table in tables
    }
    without = [path for path in paths if not zoned[path]]
    if without and len(without) < len(paths):
        other = next(path.name for path in paths if zoned[path])
        raise InputError(
            f'{without[0]}: its times name no zone, those of {other} do; give --time-zone, such as '
            'Europe/Oslo, the zone of the times that name none'
        )


# --- photographs --------------------------------------------------------------------------------


def _photographs(
    folder: Path, answers: ProtocolAnswers, told: list[str]
) -> list[tuple[datetime, Path]]:
    """Return times and files of the photographs, the oldest first."""
    table = read_foreign_table(folder / IMAGING_PROTOCOL, answers.decimal)
    column = table.needed('datetime', 'time', 'date')
    times = _moments(table, column, answers, told)
    found_names = (path for path in folder.rglob('*') if path.suffix.lower() in IMAGES)
    files = sorted(path for path in found_names if path.is_file())
    title = table.find('path', 'file', 'filename') or table.needed('image_id', 'id')
    by_name = title == table.find('path', 'file', 'filename')
    found, missing = [], []
    for moment, word in zip(times, table.columns[title], strict=True):
        file = _named(files, word, table) if by_name else _numbered(files, word, table)
        if file is None:
            missing.append(word)
        else:
            found.append((moment, file))
    _check_order(table, column, title, times, by_name=by_name, told=told)
    twice = next((file for file, count in Counter(f for _, f in found).items() if count > 1), None)
    if twice is not None:
        raise InputError(f'{table.path}: two rows mean {twice}; correct one, or remove it')
    if not found:
        raise InputError(f"{table.path}: none of its photographs is there, such as '{missing[0]}'")
    if missing:
        told.append(
            f'{table.path}: {len(missing)} of {table.length} photographs are not there and left '
            f"out, the first is '{missing[0]}'"
        )
    if answers.camera_ahead_s:
        told.append(f"{table.path}: the camera's clock is {answers.camera_ahead_s:g} s ahead")
    ahead = timedelta(seconds=answers.camera_ahead_s)
    return sorted((moment - ahead, file) for moment, file in found)


def _check_order(
    table: ForeignTable,
    column: str,
    title: str,
    times: list[datetime],
    *,
    by_name: bool,
    told: list[str],
) -> None:
    """Check that times which name no zone rise from photograph to photograph.

    Raises:
        InputError: a clock was set back, as far as ids, names or rows show.
    """
    words, names = table.columns[column], table.columns[title]
    if names_zone(words):
        return
    ids = table.find('image_id') if by_name else title
    numbers = counters([Path(name.replace('\\', '/')).stem for name in names]) if by_name else None
    if (
        numbers is None
        and ids
        and all(word.isdecimal() and len(word) <= MOST_DIGITS for word in table.columns[ids])
    ):
        numbers = [int(word) for word in table.columns[ids]]
    remark = check_order(times, words, f'{table.path}: {column}', numbers)
    told += [remark] if remark else []


def _moments(
    table: ForeignTable, title: str, answers: ProtocolAnswers, told: list[str]
) -> list[datetime]:
    where = f'{table.path}: {title}'
    found, remarks = moments(
        table.columns[title], where, order=answers.date_order, zone=answers.time_zone
    )
    told += [line for line in remarks if line not in told]
    return found


def _named(files: list[Path], word: str, table: ForeignTable) -> Path | None:
    """Return the file that a path means, whatever folder it was in.

    Raises:
        InputError: several files may be meant.
    """
    parts = Path(word.replace('\\', '/')).parts
    for count in range(len(parts), 0, -1):
        found = [file for file in files if file.parts[-count:] == parts[-count:]]
        if len(found) > 1:
            raise InputError(
                f"{table.path}: '{word}' may be {found[0]} or {found[1]}; write the folder into "
                'the path, or remove one'
            )
        if found:
            return found[0]
    return None


def _numbered(files: list[Path], word: str, table: ForeignTable) -> Path | None:
    """Return the file whose name ends with a number.

    Raises:
        InputError: several files end with it.
    """
    if not word.isdecimal() or len(word) > MOST_DIGITS:
        raise InputError(f"{table.path}: image_id is '{word}'; write a number, or a column path")
    ends = ((file, re.search(r'(\d+)$', file.stem)) for file in files)
    found = [file for file, end in ends if end and int(end[1]) == int(word)]
    if len(found) > 1:
        raise InputError(
            f'{table.path}: {found[0].name} and {found[1].name} both end in {word}; add a column '
            'path'
        )
    return found[0] if found else None


def _with_roles(
    photographs: list[tuple[datetime, Path]], begin: datetime, told: list[str]
) -> list[Photo]:
    """Return the photographs with times and roles; those before `begin` are baselines."""
    if photographs and photographs[0][0] >= begin:
        told.append(
            f'no photograph is older than the first injection: {photographs[0][1].name} is taken '
            'as the baseline'
        )
    return [
        Photo(
            (moment - begin).total_seconds(),
            'baseline' if moment < begin or number == 0 else 'state',
            f'photos/{number:05d}_{file.name}',
            file.read_bytes,
            file,
        )
        for number, (moment, file) in enumerate(photographs)
    ]


def _place(target: Path, photos: list[Photo]) -> None:
    """Link or copy the files of photographs, and write imaging.csv."""
    if not photos:
        return
    (target / 'photos').mkdir()
    for photo in photos:
        assert photo.path is not None
        try:
            os.link(photo.path, target / photo.name)
        except OSError:  # another disk, or a file system without links
            shutil.copyfile(photo.path, target / photo.name)
    rows = ((number_text(photo.time), photo.name, photo.role) for photo in photos)
    write_table(target / IMAGING_FILE, HEADER, rows)


# --- rates --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Pumped:
    """A rate [m^3/s] of a well from `start` to `end`; None: until the end of the recording."""

    start: datetime
    end: datetime | None
    well: str
    rate: WellRate


def _pumped(
    path: Path,
    rig: Rig,
    answers: ProtocolAnswers,
    told: list[str],
    commanded: list[_Pumped] | None = None,
) -> list[_Pumped]:
    """Return the rates of a protocol in the order of their times.

    Without a column of concentrations, the `commanded` rates of the same well tell them.
    """
    table = read_foreign_table(path, answers.decimal)
    starts = _moments(table, table.needed('start', 'datetime', 'time'), answers, told)
    wells = _wells(table, rig, told)
    ends = _ends(table, starts, wells, answers, told)
    rates = _rates(table, rig, answers, told)
    if commanded and table.find('concentration') is None:
        told.append(f'{path}: no column concentration: {INJECTION_PROTOCOL} tells it')
        places = zip(wells, starts, strict=True)
        shares = [_commanded_share(commanded, well, start) for well, start in places]
    else:
        shares = _concentrations(table, rates, answers, told)
    rows = []
    for number, values in enumerate(zip(starts, ends, wells, rates, shares, strict=True), 2):
        start, end, well, rate, share = values
        if end is not None and end <= start:
            raise InputError(f'{path}:{number}: does not end after its start; correct one of both')
        rows.append(_Pumped(start, end, well, WellRate(rate, share if rate > 0 else 0.0)))
    rows.sort(key=lambda row: row.start)
    _check_overlap(path, rows)
    if path.name == MEASURED_PROTOCOL:
        told += _gaps(path, rows)
    return rows


def _gaps(path: Path, rows: list[_Pumped]) -> list[str]:
    """Return a line if a log has gaps between the rates of a well, which count as a rest."""
    gaps = [
        (earlier.end, well)
        for well in dict.fromkeys(row.well for row in rows)
        for earlier, later in itertools.pairwise(row for row in rows if row.well == well)
        if earlier.end is not None and earlier.end < later.start and earlier.rate.rate
    ]
    if not gaps:
        return []
    first, well = min(gaps)
    return [
        f'{path}: {len(gaps)} gaps between rates count as a stopped pump, the first at '
        f'{first:%Y-%m-%d %H:%M:%S} (well {well}); add rows if the pump ran'
    ]


def _ends(
    table: ForeignTable,
    starts: list[datetime],
    wells: list[str],
    answers: ProtocolAnswers,
    told: list[str],
) -> Sequence[datetime | None]:
    """Return when each rate ends: at the next row of its well if no column says it."""
    title = table.find('end', 'stop')
    if title is not None:
        start = table.needed('start', 'datetime', 'time')
        zoned = [names_zone(table.columns[each]) for each in (start, title)]
        if zoned[0] != zoned[1] and not answers.time_zone:
            raise InputError(
                f'{table.path}: only one of {start} and {title} names a time zone; give '
                '--time-zone, such as Europe/Oslo, the zone of the times that name none'
            )
        return _moments(table, title, answers, told)
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


def _commanded_share(commanded: list[_Pumped], well: str, start: datetime) -> float:
    """Return the concentration of the last injection of `well` that begins by `start`, or else of
    its first one; 1 if it never injects."""
    own = [row for row in commanded if row.well == well and row.rate.rate > 0]
    begun = [row for row in own if row.start <= start]
    return (begun[-1:] or own[:1])[0].rate.concentration if own else 1.0


def _check_overlap(path: Path, rows: list[_Pumped]) -> None:
    """Check that no two rates of one well in `rows`, sorted by start, overlap.

    Raises:
        InputError: two do.
    """
    for well in dict.fromkeys(row.well for row in rows):
        own = [row for row in rows if row.well == well]
        for earlier, later in itertools.pairwise(own):
            if later.start == earlier.start or (earlier.end and later.start < earlier.end):
                raise InputError(
                    f'{path}: two rates of well {well} overlap at '
                    f'{later.start:%Y-%m-%d %H:%M:%S}; correct start or end'
                )


def _wells(table: ForeignTable, rig: Rig, told: list[str]) -> list[str]:
    """Return the well of every injection, by its name or by its place."""
    named = table.find('well', 'location')
    if named is not None and not any('(' in word for word in table.columns[named]):
        unknown = [word for word in table.columns[named] if word not in rig.wells]
        if unknown:
            raise InputError(
                f"{table.path}: unknown well '{unknown[0]}'; the rig has {', '.join(rig.wells)}"
            )
        return table.columns[named]
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
        x, z = table.needed('location_x', 'x'), table.needed('location_y', 'location_z', 'y', 'z')
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
    line = f'{table.path}: {at} is well {name}'
    told += [] if line in told else [line]
    return name


def _rates(table: ForeignTable, rig: Rig, answers: ProtocolAnswers, told: list[str]) -> list[float]:
    """Return the rates [m^3/s]."""
    titles = [title for title in table.columns if title.startswith(('rate', 'flow'))]
    if not titles:
        raise InputError(f'{table.path}: has no column of rates; name one rate [ml/min]')
    title = table.only(titles)
    where = f'{table.path}: {title}'
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
    """Return the density [kg/m^3] of the fluid in every row; without a column that of the rig."""
    title = table.find('density', 'density_kg/m3', 'density_kg_m3')
    if title is None:
        return [rig.density_kg_m3] * table.length
    factor = density_factor(unit_in(title), f'{table.path}: {title}')
    return [
        check_density(factor * value, f'{table.path}:{row}: {title}')
        for row, value in enumerate(table.numbers(title), 2)
    ]


def _without_rounding_errors(rate: float) -> float:
    """Return a converted rate [m^3/s] that is a short number in ml/h, if it nearly is one."""
    return from_ml_h(float(f'{to_ml_h(rate):.12g}'))


def _concentrations(
    table: ForeignTable, rates: list[float], answers: ProtocolAnswers, told: list[str]
) -> list[float]:
    """Return the concentrations; a row that does not inject needs none."""
    title = table.find('concentration')
    if title is not None:
        factor = share_factor(unit_in(title), f'{table.path}: {title}')
        found = [factor * value for value in table.numbers(title, [rate > 0 for rate in rates])]
        for row, share in enumerate(found, 2):
            if not 0.0 <= share <= 1.0:
                raise InputError(
                    f'{table.path}:{row}: {title} is {share / factor:g}; write a share of the '
                    'tracer stock from 0 (water) to 1, or percent with % in the title'
                )
        return found
    if answers.concentration is None:
        told.append(
            f'{table.path}: no column concentration: every injection is taken as tracer stock; '
            '--concentration says otherwise'
        )
    share = 1.0 if answers.concentration is None else answers.concentration
    return [share] * table.length


def _since(begin: datetime, rows: list[_Pumped], told: list[str]) -> list[_Pumped]:
    """Return the rates from time zero on: a recording has no earlier ones."""
    early = [row for row in rows if row.start < begin and row.rate.rate]
    if early:
        told.append(
            f'{MEASURED_PROTOCOL}: {len(early)} rates begin before the first of '
            f'{INJECTION_PROTOCOL}; their earlier part is left out. Compare the clocks'
        )
    kept = [row for row in rows if row.end is None or row.end > begin]
    return [replace(row, start=max(row.start, begin)) for row in kept]


def _schedule(rows: list[_Pumped], begin: datetime) -> Schedule:
    """Return the rates over time; a well stops at the end of a rate."""
    found: list[ScheduleRow] = []
    starts = {(row.well, row.start) for row in rows}
    for row in rows:
        found.append(ScheduleRow((row.start - begin).total_seconds(), row.well, row.rate))
        if row.end is not None and (row.well, row.end) not in starts:
            stop = WellRate(0.0, row.rate.concentration)
            found.append(ScheduleRow((row.end - begin).total_seconds(), row.well, stop))
    return Schedule(tuple(sorted(found, key=lambda each: each.time)))
