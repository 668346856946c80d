"""Photographs with their times and roles: `imaging.csv` beside the files it names."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal, get_args

from porotwin_core.errors import InputError
from porotwin_recording.table import number, number_text, read_table, write_table

HEADER = ('time_s', 'path', 'role')
Role = Literal['baseline', 'state']


@dataclass(frozen=True)
class Photo:
    """A photograph taken at `time` [s]: a `baseline` without tracer, or a `state`.

    `name` is its path relative to the experiment folder; `read` gives the bytes of the file as
    the camera wrote it. `path` is set where the photograph is a file of its own.
    """

    time: float
    role: Role
    name: str
    read: Callable[[], bytes]
    path: Path | None = None


def read_photos(folder: Path) -> tuple[Photo, ...]:
    """Return the photographs that `imaging.csv` in `folder` names, in the order of their times.

    Raises:
        InputError: one line naming file, line, value and what would mend it.
    """
    lines = read_table(folder / 'imaging.csv', HEADER, 'the time of each photograph')
    photos = [_photo(words, where, folder) for where, words in lines]
    return tuple(sorted(photos, key=lambda photo: photo.time))


def _photo(words: list[str], where: str, folder: Path) -> Photo:
    time_s, name, role = words
    time = number(time_s, f'{where}: time_s')
    if role not in get_args(Role):
        raise InputError(f"{where}: role is '{role}'; write {' or '.join(get_args(Role))}")
    if not _stays_inside(name):
        raise InputError(f"{where}: path '{name}' leaves the folder; name a file inside it")
    path = folder / name
    if not path.is_file():
        raise InputError(f"{where}: photograph '{name}' is not there; add it or remove the line")
    return Photo(time, role, name, path.read_bytes, path)  # type: ignore[arg-type]


def _stays_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and '..' not in path.parts and path.name != ''


def write_photos(folder: Path, photos: Sequence[Photo]) -> None:
    """Write `photos` byte for byte under `folder`, and `imaging.csv` with their times and roles.

    A photograph keeps its name; the folder in its name is made when it is missing.

    Raises:
        InputError: two photographs have the same name, or a name leads out of the folder.
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
    write_table(folder / 'imaging.csv', HEADER, rows)
