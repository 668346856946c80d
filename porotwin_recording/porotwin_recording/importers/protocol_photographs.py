"""The photographs of `imaging_protocol.csv`: their files, times and roles."""

import os
import re
import shutil
from collections import Counter
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

from porotwin_core.basis.csv_table import number_text, write_table
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import HEADER, IMAGING_FILE, PHOTO_SUFFIXES
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_recording.importers.clock_order import check_order, counters
from porotwin_recording.importers.foreign_table import ForeignTable, read_foreign_table
from porotwin_recording.importers.foreign_time import names_zone
from porotwin_recording.importers.protocol_answers import (
    IMAGING_PROTOCOL,
    ProtocolAnswers,
    dated_words,
    protocol_moments,
)
from porotwin_recording.tables.photos import Photo, refuse_link_outside

LISTED = f'list the photographs with their times in {IMAGING_PROTOCOL} (columns path, datetime)'
"""Remedy for times that cannot be used."""

_SYSTEM_FOLDERS = ('@eaDir', '__MACOSX')
"""Folders of a file server and of macOS that hold small copies of photographs."""

LONG_BEFORE_H = 6
"""Time before the first injection at which a baseline is odd [h]."""

MOST_DIGITS = 18
"""Most digits of an image_id; a camera counts to a few thousand."""


def protocol_photographs(
    folder: Path, answers: ProtocolAnswers, told: list[str]
) -> list[tuple[datetime, Path]]:
    """Return times and files of the photographs, the oldest first."""
    table = read_foreign_table(folder / IMAGING_PROTOCOL, answers.decimal)
    column = table.needed('datetime', 'start', 'time', 'date')
    times = protocol_moments(table, column, answers, told)
    files = sorted(path for path in visible_files(folder) if path.suffix.lower() in PHOTO_SUFFIXES)
    title = table.find('path') or table.needed('image_id')
    by_name = title == table.find('path')
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
    return sorted(found)


def visible_files(folder: Path) -> Iterator[Path]:
    """Yield the files in and below a folder that no program has put out of sight.

    Raises:
        InputError: one is a link that leads out of the folder.
    """
    return filter(Path.is_file, visible(folder))


def visible(folder: Path) -> Iterator[Path]:
    """Yield the files as `visible_files`, and also the folders.

    Raises:
        InputError: one is a link that leads out of the folder.
    """
    for path in folder.rglob('*'):
        parts = path.relative_to(folder).parts
        if not any(part.startswith('.') or part in _SYSTEM_FOLDERS for part in parts):
            if path.is_file():
                refuse_link_outside(path, folder, folder)
            yield path


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
    words, names = dated_words(table, column), table.columns[title]
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


def with_roles(
    photographs: list[tuple[datetime, Path]],
    begin: datetime,
    told: list[str],
    *,
    first_rate: datetime | None,
) -> list[Photo]:
    """Return the photographs with times and roles.

    Those before the first rate are baselines, and the first one is if there is none.

    Args:
        photographs: times and files, the oldest first.
        begin: time zero.
        told: receives a line for every assumption.
        first_rate: when the first pump begins; None without rates.

    Raises:
        InputError: a photograph is more than a year from `begin`.
    """
    for moment, file in photographs:
        if abs((moment - begin).total_seconds()) > LONGEST_EXPERIMENT_S:
            raise InputError(
                f'{file}: taken at {moment:%Y-%m-%d %H:%M:%S}, more than a year from the first '
                f'injection at {begin:%Y-%m-%d %H:%M:%S}: was the clock of the camera set? write '
                f'the right time into {IMAGING_PROTOCOL}'
            )
    before = first_rate or begin
    early = [
        file.name
        for moment, file in photographs
        if before - moment > timedelta(hours=LONG_BEFORE_H)
    ]
    if early:
        told.append(
            f'photographs from more than {LONG_BEFORE_H} h before the first injection '
            f"({len(early)}, such as '{early[0]}') count as baselines; are they of another run? "
            'take them out'
        )
    if first_rate and photographs and photographs[-1][0] < first_rate:
        told.append(
            'all photographs are older than the first injection, so all are baselines: compare '
            'the clocks of camera and pumps; --camera-ahead tells by how much that of the camera '
            'is ahead'
        )
    if photographs and photographs[0][0] >= before:
        why = 'no photograph is older than the first injection' if first_rate else 'no pump log'
        told.append(f'{why}: {photographs[0][1].name} is taken as the baseline')
    return [
        Photo(
            (moment - begin).total_seconds(),
            'baseline' if moment < before or number == 0 else 'state',
            f'photos/{number:05d}_{file.name}',
            file.read_bytes,
            file,
        )
        for number, (moment, file) in enumerate(photographs)
    ]


def place_photographs(target: Path, photos: list[Photo]) -> None:
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
