"""Photographs of an experiment folder, with the times and roles in its `imaging.csv`."""

import contextlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from porotwin_core.basis.csv_table import number_text, write_table
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import (
    DILUTION_HEADER,
    HEADER,
    IMAGING_FILE,
    PhotoLine,
    Role,
    read_photo_list,
    stays_inside,
)
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.basis.whole_file import whole_file

VIRTUAL_CAMERA: Final = 'PoroTwin virtual camera'
"""Model of the camera in the EXIF of photographs that the virtual rig took."""


@dataclass(frozen=True)
class Photo:
    """A photograph on disk, in a file of its own or in a bag.

    Attributes:
        time: exposure, in seconds since the start of the experiment.
        role: `baseline` (sand and water only), `state` (with tracer) or `dilution` (tracer of a
            known concentration, for a calibration).
        name: path relative to the experiment folder.
        read: returns the bytes of the camera's file.
        path: the file; None for a photograph in a bag.
        concentration: concentration of a dilution [-], 1 = tracer stock; None for other roles.
    """

    time: float
    role: Role
    name: str
    read: Callable[[], bytes]
    path: Path | None = None
    concentration: float | None = None

    @property
    def is_virtual(self) -> bool:
        """Whether the virtual rig took it, by the head of its file; False if it is not readable."""
        first = io.DEFAULT_BUFFER_SIZE
        with contextlib.suppress(OSError, InputError):
            head = self.read()[:first] if self.path is None else read_regular(self.path, first)
            return VIRTUAL_CAMERA.encode() in head
        return False


def read_photos(folder: Path) -> tuple[Photo, ...]:
    """Return the photographs that are listed in `imaging.csv` of `folder`, ordered by time.

    Raises:
        InputError: one line that names file, line, value and remedy.
    """
    photos = [_photo(line, folder) for line in read_photo_list(folder / IMAGING_FILE)]
    return tuple(sorted(photos, key=lambda photo: photo.time))


def _photo(line: PhotoLine, folder: Path) -> Photo:
    time, name, role, concentration, where = line
    if abs(time) > LONGEST_EXPERIMENT_S:
        raise InputError(
            f'{where}: time_s {time:g} is more than a year from the start; '
            'write seconds since the start of the experiment'
        )
    path = folder / name
    if not path.is_file():
        raise InputError(
            f"{where}: photograph '{name}' is not there; add it or remove the line"
            + _likely_name(path, name)
        )
    refuse_link_outside(path, folder, where)
    return Photo(time, role, name, path.read_bytes, path, concentration)


def refuse_link_outside(path: Path, folder: Path, where: object) -> None:
    """Check that the file `path` in `folder` lies there; `where` opens the message.

    Raises:
        InputError: it is a link, or lies behind one, that leads out of the folder.
    """
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(
            f"{where}: '{path.relative_to(folder)}' is a link that leads out of the folder; put a "
            'copy of the file there'
        )


def _likely_name(path: Path, name: str) -> str:
    """Return what was probably meant by the `name` of a photograph that is not at `path`."""
    if '\\' in name:
        return ', with / between folders'
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    alike = [file.name for file in beside if file.name.lower() == path.name.lower()]
    return f"; did you mean '{alike[0]}'?" if alike else ''


def write_photos(
    folder: Path, photos: Sequence[Photo], *, progress: Callable[[int], None] = lambda _: None
) -> None:
    """Write `photos` byte for byte below `folder`, and their times and roles as `imaging.csv`.

    Every photograph keeps its name. Missing folders are created. A file that is there already is
    kept: an interrupted call has written it. `progress` gets the number of written photographs.

    Raises:
        InputError: two photographs have the same name, or a name leads out of `folder`.
    """
    names = set[str]()
    for number, photo in enumerate(photos, start=1):
        if photo.name in names:
            raise InputError(f"{folder}: two photographs are named '{photo.name}'; rename one")
        if not stays_inside(photo.name):
            raise InputError(
                f"{folder}: photograph '{photo.name}' would leave the folder; rename it"
            )
        names.add(photo.name)
        path = folder / photo.name
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as unfinished:
                unfinished.write_bytes(photo.read())
        progress(number)
    rows = [(number_text(photo.time), photo.name, photo.role) for photo in photos]
    if all(photo.concentration is None for photo in photos):
        write_table(folder / IMAGING_FILE, HEADER, iter(rows))
        return
    known = ['' if p.concentration is None else number_text(p.concentration) for p in photos]
    with_known = ((*row, text) for row, text in zip(rows, known, strict=True))
    write_table(folder / IMAGING_FILE, DILUTION_HEADER, with_known)
