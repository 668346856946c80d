"""Photographs without a list: the camera wrote their times into the files, or into the names.

Times in files count (EXIF), unless more names hold a time. Both must fit together: a camera counts
upwards in the names, or writes a time there too.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from statistics import median

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.experiment_folder import CAMERA_ENDINGS
from porotwin_recording.importers.clock_order import counters, falls
from porotwin_recording.importers.foreign_time import moments, names_zone
from porotwin_recording.importers.protocol_answers import ProtocolAnswers
from porotwin_recording.importers.protocol_photographs import LISTED, visible_files

ReadExposure = Callable[[Path], str]
"""Returns the time that a camera wrote into a file, such as 2024-05-31 14:30:00.25+02:00; '' if
there is none."""

_NAMED_TIME = re.compile(
    r'(?<!\d)(20\d\d)[-_.]?(\d\d)[-_.]?(\d\d)[-_. T]*(\d\d)[-_.]?(\d\d)[-_.]?(\d\d)(?:\d{3})?(?!\d)'
)
"""A time in a name, as in IMG_20240531_143000 or 2024-05-31 14.30.00, perhaps with milliseconds."""
_PICTURE = '.png'
"""Ending of pictures of sands and zones too: here a time in the name tells a photograph."""
_UNREAD = (
    '.heic',
    '.heif',
    '.webp',
    '.dng',
    '.nef',
    '.cr2',
    '.cr3',
    '.arw',
    '.raf',
    '.orf',
    '.rw2',
)
"""Endings of photographs that cannot be read."""
_SAME_S = 5.0
"""Times in names may differ by this from those in files [s]: a name may tell when a file was
saved."""


@dataclass(frozen=True)
class DatedPhotographs:
    """The photographs of a folder.

    Attributes:
        exposures: times and files, the oldest first.
        zoned: whether the times name their zone.
    """

    exposures: list[tuple[datetime, Path]]
    zoned: bool


def camera_files(folder: Path) -> list[Path]:
    """Return the files in and below a folder that may be photographs, in the order of names."""
    return sorted(path for path in visible_files(folder) if _is_of_camera(path))


def _is_of_camera(path: Path) -> bool:
    ending = path.suffix.lower()
    return ending in CAMERA_ENDINGS or (ending == _PICTURE and bool(_named_time(path)))


def dated_photographs(
    folder: Path, answers: ProtocolAnswers, exposure: ReadExposure, told: list[str]
) -> DatedPhotographs:
    """Return the photographs of a folder that hold their times, and tell where these are from.

    Raises:
        InputError: times in files do not fit the names, or two photographs have the same time.
    """
    visible = sorted(visible_files(folder))
    files = [path for path in visible if _is_of_camera(path)]
    _tell_unread(folder, [path for path in visible if path.suffix.lower() in _UNREAD], told)
    words = [exposure(path) for path in files]
    named = [_named_time(path) for path in files]
    by_name = sum(map(bool, named)) > sum(map(bool, words))
    _check_names(files, words, named, told, by_name=by_name)
    origin, words = ('names', named) if by_name else ('EXIF', words)
    _tell_missing(files, words, folder, told)
    dated = [(path, word) for path, word in zip(files, words, strict=True) if word]
    if not dated:
        return DatedPhotographs([], zoned=False)
    found, written = [path for path, _ in dated], [word for _, word in dated]
    zoned = _zoned(found, written)
    times, remarks = moments(written, '', zone=answers.time_zone, places=[*map(str, found)])
    told += [line for line in remarks if line not in told]
    exposures = sorted(zip(times, found, strict=True))
    first, last = exposures[0][0], exposures[-1][0]
    told.append(
        f'photographs with times in {origin}: {len(dated)}, from {first:%Y-%m-%d %H:%M:%S} to '
        f'{last:%Y-%m-%d %H:%M:%S}'
    )
    _check_same(exposures)
    _check_counters(found, times, zoned=zoned or bool(answers.time_zone))
    return DatedPhotographs(exposures, zoned)


def _tell_unread(folder: Path, unread: Sequence[Path], told: list[str]) -> None:
    if unread:
        told.append(
            f'{folder}: photographs in other formats are left out ({len(unread)}, such as '
            f"'{unread[0].name}'); save them as JPEG or TIFF with their times"
        )


def _named_time(path: Path) -> str:
    """Return the time in the name of a file, '' if there is none."""
    match = _NAMED_TIME.search(path.stem)
    if match is None:
        return ''
    try:
        return str(datetime.strptime(''.join(match.groups()), '%Y%m%d%H%M%S'))
    except ValueError:  # digits that are no time
        return ''


def _check_names(
    files: Sequence[Path],
    words: Sequence[str],
    named: Sequence[str],
    told: list[str],
    *,
    by_name: bool,
) -> None:
    """Compare times in files with those in names, and tell how they differ.

    Raises:
        InputError: a few differ otherwise than the others, so that one of their times is wrong.
    """
    both = [
        (path, word, name)
        for path, word, name in zip(files, words, named, strict=True)
        if word and name
    ]
    if not both:
        return
    lags = [(_local(name) - _local(word)).total_seconds() for _, word, name in both]
    usual = median(lags)
    others = [at for at, lag in enumerate(lags) if abs(lag - usual) > _SAME_S]
    if others and len(others) < len(both) / 2:
        path, word, name = both[others[0]]
        raise InputError(
            f'{path}: its EXIF time is {word}, its name says {name}, and most others differ by '
            f'{usual:.0f} s; correct it, or {LISTED}'
        )
    if others or abs(usual) > _SAME_S:
        ahead = (
            f'EXIF times of {len(both)} photographs, such as {both[0][0].name}, are not used: the '
            'names say'
            if by_name
            else 'EXIF times count; names say'
        )
        told.append(
            f'{ahead} {min(lags):.0f} s to {max(lags):.0f} s more. --camera-ahead corrects the '
            'clock of the camera'
        )


def _local(word: str) -> datetime:
    """Return the clock time in a word, without its zone."""
    return datetime.fromisoformat(word).replace(tzinfo=None)


def _tell_missing(
    files: Sequence[Path], words: Sequence[str], folder: Path, told: list[str]
) -> None:
    """Tell photographs without a time."""
    missing = [path for path, word in zip(files, words, strict=True) if not word]
    if missing:
        told.append(
            f'{folder}: {len(missing)} of {len(files)} photographs hold no time and are left out, '
            f'the first is {missing[0].relative_to(folder)}; if they belong to it, {LISTED}'
        )


def _zoned(files: Sequence[Path], words: Sequence[str]) -> bool:
    """Return whether the times name their zone.

    Raises:
        InputError: some do and some do not.
    """
    without = [path for path, word in zip(files, words, strict=True) if not names_zone([word])]
    if without and len(without) < len(files):
        raise InputError(
            f'{without[0]}: its EXIF time has no zone (OffsetTimeOriginal, or OffsetTime of an '
            f'unchanged file), as {len(without)} of {len(files)} photographs: are they of two '
            f'cameras? {LISTED}'
        )
    return not without


def _check_same(exposures: Sequence[tuple[datetime, Path]]) -> None:
    """Refuse two photographs with the same time: one is a copy, or their order is not known."""
    for (first, one), (second, other) in itertools.pairwise(exposures):
        if first == second:
            raise InputError(
                f'{one} and {other} have the same time {first:%Y-%m-%d %H:%M:%S}: remove one if '
                f'it is a copy; if the camera writes whole seconds only, {LISTED}'
            )


def _check_counters(files: Sequence[Path], times: Sequence[datetime], *, zoned: bool) -> None:
    """Refuse times that fall while the camera's counter in the names rises."""
    numbers = counters([path.stem for path in files])
    fallen = falls(times, numbers) if numbers is not None else []
    if fallen:
        before, after = fallen[0]
        zone = '' if zoned else 'give --time-zone, such as Europe/Oslo, if summer time ended; else '
        raise InputError(
            f'{files[after]}: its EXIF time {times[after]:%Y-%m-%d %H:%M:%S} is earlier than '
            f'{times[before]:%H:%M:%S} of {files[before].name}, the one before it by name: was the '
            f'clock set back, or were files renamed? {zone}{LISTED}'
        )
