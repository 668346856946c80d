"""The protocol `imaging.csv` (time_s, path, role): times and roles of the files in a folder."""

import csv
import math
from pathlib import Path
from typing import NamedTuple, cast, get_args

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_text
from porotwin_core.basis.remark import Remark
from porotwin_imaging.sources.camera_source import Role

FILE_NAME = 'imaging.csv'


class ProtocolEntry(NamedTuple):
    """Exposure time [s] since the start of the experiment, and role of a photograph."""

    time: float
    role: Role


def read_protocol(path: Path) -> dict[Path, ProtocolEntry]:
    """Return the entry of every file that the protocol `path` names.

    Raises:
        InputError: a line is not `time_s,path,role`, or the file is no text in UTF-8.
    """
    entries: dict[Path, ProtocolEntry] = {}
    try:
        with open_text(path, 'utf-8-sig') as file:
            for line in csv.DictReader(file, skipinitialspace=True):
                photo, entry = _entry(path, line)
                entries[photo] = entry
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: not readable ({error}); save it as CSV in UTF-8') from None
    return entries


def _entry(path: Path, line: dict[str, str]) -> tuple[Path, ProtocolEntry]:
    """Return the file and the entry of one line."""
    try:
        time, role = float(line['time_s']), line['role']
        if role not in get_args(Role) or not math.isfinite(time):
            raise ValueError
        return (path.parent / line['path']).resolve(), ProtocolEntry(time, cast(Role, role))
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f'{path}: cannot read {dict(line)}; write time_s,path,role with a finite number and '
            'role baseline or state'
        ) from None


class GrowingProtocol:
    """The protocol in `folder` or its parent, read again when it changes; it may appear later.

    Attributes:
        entries: the entries by file; empty without a protocol.
    """

    def __init__(self, folder: Path) -> None:
        self._paths = (folder / FILE_NAME, folder.parent / FILE_NAME)
        self._stamp: tuple[Path, int, int] | None = None
        self._fault = ''
        self.entries: dict[Path, ProtocolEntry] = {}

    def refresh(self) -> tuple[bool, list[Remark]]:
        """Return whether the entries have changed, and problems."""
        for path in self._paths:
            try:
                status = path.stat()
            except OSError:  # no protocol here
                continue
            stamp = (path, status.st_mtime_ns, status.st_size)
            if stamp == self._stamp:
                return False, []
            try:
                self.entries = read_protocol(path)
            except InputError as error:
                self._stamp = stamp
                return False, [Remark(FILE_NAME, '', str(error), '', code='wrong_protocol')]
            except OSError as error:  # tried again, because a share may be away for a moment
                return False, self._told_once(f'{path}: cannot be read: {error.strerror}')
            self._stamp, self._fault = stamp, ''
            return True, []
        return False, []

    def _told_once(self, fault: str) -> list[Remark]:
        """Return the problem of a protocol that cannot be read, the first time."""
        if fault == self._fault:
            return []
        self._fault = fault
        remedy = 'until it can, roles and times are those without it; allow this user to read it'
        return [Remark(FILE_NAME, '', fault, remedy, code='unreadable')]
