"""Photographs of an experiment folder, with the times and roles in its `imaging.csv`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal, get_args

from porotwin_core.errors import InputError
from porotwin_recording.csv_table import number_text, parse_number, read_table, write_table

IMAGING_FILE = 'imaging.csv'
HEADER = ('time_s', 'path', 'role')
Role = Literal['baseline', 'state']


@dataclass(frozen=True)
class Photo:
    """A photograph on disk, in a file of its own or in a bag.

    Attributes:
        time: exposure, in seconds since the start of the experiment.
        role: `baseline` (sand and water only) or `state` (with tracer).
        name: path relative to the experiment folder.
        read: returns the bytes of the camera's file.
        path: the file; None for a photograph in a bag.
    """

    time: float
    role: Role
    name: str
    read: Callable[[], bytes]
    path: Path | None = None


def read_photos(folder: Path) -> tuple[Photo, ...]:
    """Return the photographs that are listed in `imaging.csv` of `folder`, ordered by time.

    Raises:
        InputError: one line that names file, line, value and remedy.
    """
    lines = read_table(folder / IMAGING_FILE, HEADER, 'the time of each photograph')
    photos = [_photo(words, where, folder) for where, words in lines]
    return tuple(sorted(photos, key=lambda photo: photo.time))


def _photo(words: list[str], where: str, folder: Path) -> Photo:
    time_s, name, role = words
    time = parse_number(time_s, f'{where}: time_s')
    if role not in get_args(Role):
        raise InputError(f"{where}: role is '{role}'; write {' or '.join(get_args(Role))}")
    if not _stays_inside(name):
        raise InputError(f"{where}: path '{name}' leaves the folder; name a file inside it")
    path = folder / name
    if not path.is_file():
        slash = ', with / between folders' if '\\' in name else ''
        raise InputError(
            f"{where}: photograph '{name}' is not there; add it or remove the line{slash}"
        )
    return Photo(time, role, name, path.read_bytes, path)  # type: ignore[arg-type]


def _stays_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and '..' not in path.parts and path.name != ''


def write_photos(folder: Path, photos: Sequence[Photo]) -> None:
    """Write `photos` byte for byte below `folder`, and their times and roles as `imaging.csv`.

    Every photograph keeps its name. Missing folders are created.

    Raises:
        InputError: two photographs have the same name, or a name leads out of `folder`.
    """
    names = set[str]()
    for photo in photos:
        if photo.name in names:
            raise InputError(f"{folder}: two photographs are named '{photo.name}'; rename one")
        if not _stays_inside(photo.name):
            raise InputError(
                f"{folder}: photograph '{photo.name}' would leave the folder; rename it"
            )
        names.add(photo.name)
        path = folder / photo.name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(photo.read())
    rows = ((number_text(photo.time), photo.name, photo.role) for photo in photos)
    write_table(folder / IMAGING_FILE, HEADER, rows)
