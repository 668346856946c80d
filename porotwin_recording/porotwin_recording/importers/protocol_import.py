"""Folders with `imaging_protocol.csv` and `injection_protocol.csv`, as DarSIA uses them, or with
photographs alone or beside a `rates.csv`.

Columns of the imaging: `image_id` or `path`, and `datetime`. Columns of the injection: `location`
(a well), or `location_x` and `location_y` [m]; `start`, `end`, and a rate with its unit, such as
`rate_ml/min`. See https://github.com/pmgbergen/DarSIA. The log of a flow meter or a balance,
`measured_protocol.csv`, has the columns of the injection, and `level_protocol.csv` logs levels.
"""

import functools
import os
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import IMAGING_FILE
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, to_ml_h
from porotwin_core.rig import Rig
from porotwin_recording.experiment.experiment_folder import (
    COMMANDED_FILE,
    MAPS_FILE,
    MEASURED_FILE,
    write_folder,
)
from porotwin_recording.importers.dated_photographs import (
    ReadExposure,
    camera_files,
    dated_photographs,
)
from porotwin_recording.importers.foreign_arrays import ARRAY_FILES
from porotwin_recording.importers.foreign_table import bare_title, read_foreign_table
from porotwin_recording.importers.foreign_time import moments, names_zone
from porotwin_recording.importers.open_question import settled
from porotwin_recording.importers.protocol_answers import (
    IMAGING_PROTOCOL,
    INJECTION_PROTOCOL,
    LEVEL_PROTOCOL,
    MEASURED_PROTOCOL,
    ProtocolAnswers,
    dated_words,
)
from porotwin_recording.importers.protocol_levels import with_logged_levels
from porotwin_recording.importers.protocol_photographs import (
    LISTED,
    place_photographs,
    protocol_photographs,
    with_roles,
)
from porotwin_recording.importers.protocol_rates import (
    START,
    check_measured,
    pumped_rates,
    schedule_of,
    since,
)
from porotwin_recording.importers.words_of_languages import NAMES
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.rates import read_rates
from porotwin_recording.tables.recorded_data import RecordedData

PROTOCOLS = (IMAGING_PROTOCOL, INJECTION_PROTOCOL, MEASURED_PROTOCOL, LEVEL_PROTOCOL)


def is_lab_folder(folder: Path) -> bool:
    """Return whether a folder has one of the protocols, or photographs that no imaging.csv lists.

    Photographs beside maps are those of a finished experiment.
    """
    if any((folder / name).is_file() for name in PROTOCOLS):
        return True
    recorded = any((folder / name).exists() for name in (MAPS_FILE, IMAGING_FILE))
    return not recorded and bool(camera_files(folder))


def import_protocols(
    folder: Path,
    target: Path,
    rig: Rig,
    answers: ProtocolAnswers,
    *,
    exposure: ReadExposure = lambda _: '',
) -> list[str]:
    """Write an experiment folder from protocols and photographs; return the assumptions made.

    Time zero is `answers.time_zero`, which a rates.csv needs. In a pump log it is the first
    commanded rate above or below zero, else the first measured one. Without rates it is the first
    photograph. Photographs before the first rate are baselines. Files are linked where the file
    system allows it. Without a list of photographs, they have the times that they hold.

    Args:
        folder: the folder with the protocols.
        target: the new experiment folder.
        rig: the rig, whose wells the locations mean.
        answers: answers to the questions that the protocols leave open.
        exposure: reads the time that a camera wrote into a file.

    Raises:
        InputError: one line with the file, the fault and the remedy.
    """
    cached = functools.cache(exposure)
    read = settled(lambda tried: _read(folder, rig, tried, cached), answers)
    write_folder(target, read.rates)
    place_photographs(target, read.photos)
    for file in target.iterdir():  # a recording has the date of its oldest file
        if file.is_file():
            os.utime(file, (read.begin.timestamp(), read.begin.timestamp()))
    return [
        *read.told,
        *(
            f'{name}: not read, only protocols and photographs are; ./porotwin import '
            f'{folder / name} TARGET reads maps'
            for name in sorted(
                path.name for path in folder.iterdir() if path.suffix.lower() in ARRAY_FILES
            )
        ),
    ]


class _ReadProtocols(NamedTuple):
    """The content of a folder: rates and photographs from time zero on, and all assumptions."""

    begin: datetime
    rates: RecordedData
    photos: list[Photo]
    told: list[str]

    @property
    def in_words(self) -> str:
        """The times of rates and photographs."""
        times = [photo.time for photo in self.photos]
        seen = f', photographs from {min(times):.0f} to {max(times):.0f} s' if times else ''
        known = self.rates.known_rates
        zero = f'time zero {self.begin:%Y-%m-%d %H:%M:%S}'
        if known is None:
            return f'{zero}{seen}'
        largest = to_ml_h(max(abs(row.rate.rate) for row in known.rows))
        span = f'{known.rows[0].time:.0f} to {known.rows[-1].time:.0f} s'
        return f'{zero}, rates from {span} up to {largest:.6g} ml/h{seen}'

    @property
    def is_apart(self) -> bool:
        """Whether photographs and rates have no time in common."""
        known, times = self.rates.known_rates, [photo.time for photo in self.photos]
        return (
            known is not None
            and bool(times)
            and (max(times) < known.rows[0].time or min(times) > known.rows[-1].time)
        )


def _read(
    folder: Path, rig: Rig, answers: ProtocolAnswers, exposure: ReadExposure
) -> _ReadProtocols:
    """Return the content of the folder for the `answers`.

    Raises:
        InputError: as `import_protocols`.
        QuestionError: other answers may mend it.
    """
    told: list[str] = []
    there = [name for name in PROTOCOLS if (folder / name).is_file()]
    _check_answers(folder, there, answers)
    zero = _time_zero(answers, told)
    zoned = _zones([folder / name for name in there], answers)
    zoned |= {'--time-zero': names_zone([answers.time_zero])} if zero else {}
    if IMAGING_PROTOCOL in there:
        photographs = protocol_photographs(folder, answers, told)
    else:
        dated = dated_photographs(folder, answers, exposure, told)
        photographs = dated.exposures
        zoned |= {f'photographs in {folder}': dated.zoned} if photographs else {}
    if not photographs and INJECTION_PROTOCOL not in there:
        raise InputError(
            f'{folder}: has no {INJECTION_PROTOCOL}, and no photograph holds its time; {LISTED}'
        )
    photographs = _by_pumps(photographs, answers, told)
    logged = _logged_rates(folder, rig, there, answers, told)
    _check_clocks(zoned, answers)
    begin = logged.begin or zero or min(moment for moment, _ in photographs)
    rates = logged.rates or _own_rates(folder, rig)
    if LEVEL_PROTOCOL in there:
        rates = with_logged_levels(folder / LEVEL_PROTOCOL, rates, begin, answers, told)
    photos = with_roles(photographs, begin, told, first_rate=_first_rate(rates, begin))
    in_utc = bool(answers.time_zone) or all(zoned.values())
    told.append(f'time zero is {begin:%Y-%m-%d %H:%M:%S}' + ' UTC' * in_utc)
    return _ReadProtocols(begin, rates, photos, told)


def _check_answers(folder: Path, there: Sequence[str], answers: ProtocolAnswers) -> None:
    """Check the answers about times against the files that are `there`.

    Raises:
        InputError: the lead of the camera is no lead, the time zero is missing or told twice, or
            the folder has rates of two kinds.
    """
    if not abs(answers.camera_ahead_s) <= LONGEST_EXPERIMENT_S:  # also if it is no number
        raise InputError(
            f'--camera-ahead {answers.camera_ahead_s:g}: give the lead of the clock in seconds, at '
            f'most a year ({LONGEST_EXPERIMENT_S:.0f})'
        )
    logs = [name for name in there if name in (INJECTION_PROTOCOL, MEASURED_PROTOCOL)]
    own = [name for name in (COMMANDED_FILE, MEASURED_FILE) if (folder / name).is_file()]
    if logs and answers.time_zero:
        raise InputError(
            f'--time-zero: {folder / logs[0]} holds dates and times, so that its first rate is '
            'time zero; leave the option out'
        )
    if logs and own:
        raise InputError(f'{folder}: has {logs[0]} and {own[0]}; take one of them out')
    if own and not answers.time_zero:
        raise InputError(
            f"{folder / own[0]}: counts seconds; give --time-zero '2024-05-31 14:30:00', the date "
            'and time of its second 0'
        )


class _Logged(NamedTuple):
    """The rates of pump logs, from `begin` on; None each without a log."""

    begin: datetime | None
    rates: RecordedData | None


def _logged_rates(
    folder: Path, rig: Rig, there: Sequence[str], answers: ProtocolAnswers, told: list[str]
) -> _Logged:
    """Return the rates of the pump logs that are `there`.

    Raises:
        InputError: a log cannot be read, or two logs contradict each other.
    """
    commanded = measured = None
    if INJECTION_PROTOCOL in there:
        commanded = pumped_rates(folder / INJECTION_PROTOCOL, rig, answers, told)
    if MEASURED_PROTOCOL in there:
        measured = pumped_rates(folder / MEASURED_PROTOCOL, rig, answers, told, commanded)
    pumped = commanded or measured
    if not pumped:
        return _Logged(None, None)
    begin = min([row.start for row in pumped if row.rate.rate] or [row.start for row in pumped])
    asked = schedule_of(since(begin, commanded, told), begin) if commanded else None
    delivered = schedule_of(since(begin, measured, told), begin, asked) if measured else None
    if asked is not None and delivered is not None:
        last = max(row.end or row.start for row in measured or ())
        check_measured(folder / MEASURED_PROTOCOL, asked, delivered, is_over=last <= begin)
    return _Logged(begin, RecordedData(rig, commanded=asked, measured=delivered))


def _first_rate(rates: RecordedData, begin: datetime) -> datetime | None:
    """Return when the first pump begins, if time zero is `begin`; None without rates."""
    known = rates.commanded or rates.measured
    if known is None:
        return None
    running = [row.time for row in known.rows if row.rate.rate] or [0.0]
    return begin + timedelta(seconds=min(running))


def _own_rates(folder: Path, rig: Rig) -> RecordedData:
    """Return the rates of `rates.csv` and `rates_measured.csv` as far as they are there."""
    commanded, measured = (
        read_rates(folder / name, rig.wells) if (folder / name).is_file() else None
        for name in (COMMANDED_FILE, MEASURED_FILE)
    )
    return RecordedData(rig, commanded=commanded, measured=measured)


def _time_zero(answers: ProtocolAnswers, told: list[str]) -> datetime | None:
    """Return the time zero of a person's answer, None without one.

    Raises:
        InputError: it is no date and time, or has no time of day.
    """
    word = answers.time_zero
    if not word:
        return None
    (moment,), remarks = moments(
        [word],
        '--time-zero',
        order=answers.date_order,
        zone=answers.time_zone,
        places=['--time-zero'],
    )
    if ':' not in word:
        raise InputError(f"--time-zero '{word}': has no time of day; write it as in '{word} 14:30'")
    told += [line for line in remarks if line not in told]
    return moment


def _by_pumps(
    photographs: list[tuple[datetime, Path]], answers: ProtocolAnswers, told: list[str]
) -> list[tuple[datetime, Path]]:
    """Return the photographs with times of the pumps' clock."""
    if not answers.camera_ahead_s or not photographs:
        return photographs
    told.append(f"the camera's clock is {answers.camera_ahead_s:g} s ahead")
    ahead = timedelta(seconds=answers.camera_ahead_s)
    return [(moment - ahead, path) for moment, path in photographs]


def _zones(paths: list[Path], answers: ProtocolAnswers) -> dict[str, bool]:
    """Return whether the times of each protocol name their zone."""
    tables = [read_foreign_table(path, answers.decimal) for path in paths]
    return {
        str(table.path): any(
            names_zone(dated_words(table, title), answers.date_numbers)
            for title in table.columns
            if any(bare_title(title) in NAMES[quantity] for quantity in (*START, 'end'))
        )
        for table in tables
    }


def _check_clocks(zoned: dict[str, bool], answers: ProtocolAnswers) -> None:
    """Check that the times of all protocols and photographs can be compared.

    Raises:
        InputError: one names its zone, and nothing says the zone of another.
    """
    without = [name for name, names in zoned.items() if not names]
    if answers.time_zone or not without or len(without) == len(zoned):
        return
    other = next(name for name, names in zoned.items() if names)
    raise InputError(
        f'{without[0]}: the times name no zone, unlike those of {other}; give --time-zone, such as '
        'Europe/Oslo, the zone of the times that name none'
    )
