"""The list of photographs `imaging.csv`: time, path and role of each, and known dilutions."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple, cast, get_args

from porotwin_core.basis.csv_table import parse_number, read_table
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_text

IMAGING_FILE = 'imaging.csv'
HEADER = ('time_s', 'path', 'role')
DILUTION_HEADER = (*HEADER, 'concentration')
"""Header of a list with known dilutions."""
PHOTO_SUFFIXES = ('.jpg', '.jpeg', '.png', '.tif', '.tiff')
"""Endings of the files that imaging reads, in small letters."""
Role = Literal['baseline', 'state', 'dilution']


class PhotoLine(NamedTuple):
    """A line of the list.

    Attributes:
        time: exposure, in seconds since the start of the experiment; beside a camera also
            since 1970.
        name: path relative to the folder of the list, below it.
        role: `baseline` (sand and water only), `state` (with tracer) or `dilution` (tracer of a
            known concentration, for a calibration).
        concentration: of a dilution [-], 1 = tracer stock; None for other roles.
        where: file and line, for messages.
    """

    time: float
    name: str
    role: Role
    concentration: float | None
    where: str


def read_photo_list(path: Path) -> Iterator[PhotoLine]:
    """Yield the lines of the list at `path`; the photographs need not be there.

    Raises:
        InputError: one line that names file, line, value and remedy.
    """
    for where, words in read_table(path, _header(path), 'the time of each photograph'):
        time_s, name, role, *rest = words
        time = parse_number(time_s, f'{where}: time_s')
        if role not in get_args(Role):
            raise InputError(f"{where}: role is '{role}'; write {' or '.join(get_args(Role))}")
        concentration = _concentration(role, rest[0] if rest else '', where)
        if not stays_inside(name):
            raise InputError(f"{where}: path '{name}' leaves the folder; name a file inside it")
        yield PhotoLine(time, name, cast(Role, role), concentration, where)


def _header(path: Path) -> tuple[str, ...]:
    """Return the header that the list should have: with concentrations if it names them."""
    try:
        with open_text(path, 'utf-8-sig', errors='replace') as file:
            named = file.readline().rstrip().endswith(DILUTION_HEADER[-1])
    except OSError:  # read_table tells the fault
        named = False
    return DILUTION_HEADER if named else HEADER


def _concentration(role: str, text: str, where: str) -> float | None:
    """Return the concentration of a dilution, None for other roles."""
    if role != 'dilution':
        if text:
            raise InputError(f'{where}: concentration belongs to role dilution; leave it empty')
        return None
    value = parse_number(text, f'{where}: concentration')
    if not 0 < value <= 1:
        raise InputError(f'{where}: concentration is {text}; write a share of stock, 0 to 1')
    return value


def stays_inside(name: str) -> bool:
    """Return whether the path `name` names a file below the folder that it is relative to."""
    path = PurePosixPath(name)
    return not path.is_absolute() and '..' not in path.parts and path.name != ''
