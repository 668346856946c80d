"""The memory of the photographs that were sent; a restarted camera goes on after the last one.

A folder holds `sent.jsonl`, one line per photograph, and the baselines. Lines are only added, so
that an interrupted write costs one line. A line that cannot be read is left out. Without the folder
(a full disk, a lost file) the camera works on and forgets when it ends.
"""

import hashlib
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.parent import PARENT
from porotwin_core.basis.whole_file import whole_file

LINES_FILE = 'sent.jsonl'
MOST_BASELINES = 8
"""Baselines that are kept, offered to late subscribers and averaged; more hardly reduce noise."""

FileMark = tuple[int, int, int]
"""Size [bytes], time of change and of status change [ns]; an unchanged file keeps its mark."""


@dataclass(frozen=True)
class SentPhoto:
    """A photograph that was sent or left out for good.

    Attributes:
        name: name of the file, or of the photograph.
        digest: digest of its bytes.
        mark: mark of the file, empty if it is none.
        stamp: its stamp [s]; None if it was left out.
        correction: correction of the camera's clock at that time [s].
        role: 'baseline', 'state', or empty if it was left out.
    """

    name: str
    digest: str
    mark: tuple[int, ...] = ()
    stamp: float | None = None
    correction: float = 0.0
    role: str = ''


def digest_of(data: bytes) -> str:
    """Return the digest of a file's bytes."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def folder_of_launch(source: str) -> Path:
    """Return the folder for the camera `source` of this launch, in the folder of temporary files.

    Nodes that the same process starts share it, so a restarted camera finds it and a new launch
    does not.
    """
    launcher = int(os.environ.get(PARENT, os.getppid()))
    which = digest_of(source.encode('utf-8', 'backslashreplace'))[:8]
    name = f'camera-{launcher}-{_began(launcher)}-{which}'
    return Path(tempfile.gettempdir()) / f'porotwin-{os.getuid()}' / name


def forget_ended_launches(folder: Path) -> None:
    """Delete the folders beside `folder_of_launch(...)` whose launch has ended."""
    for other in folder.parent.glob('camera-*-*-*'):
        _, launcher, began, _ = other.name.split('-', 3)
        if launcher.isdecimal() and began != _began(int(launcher)):
            shutil.rmtree(other, ignore_errors=True)


def _began(process: int) -> str:
    """Return when a process began, in ticks since the start of the computer; '0' if it ended."""
    try:
        status = Path(f'/proc/{process}/stat').read_text(encoding='utf-8', errors='replace')
        return status.rpartition(')')[2].split()[19]
    except (OSError, IndexError):  # no Linux, or the process has ended
        return '0'


class SentPhotos:
    """Remembers the photographs of a camera across restarts.

    Args:
        folder: where it remembers; None: only in memory.

    Attributes:
        began_before: True if the folder was used before.
        problem: one line if the memory cannot be written or was damaged, else empty.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._digests: dict[bytes, str] = {}
        self._pending: list[SentPhoto] = []
        self.last: SentPhoto | None = None
        self.problem = ''
        self.began_before = folder is not None and (folder / LINES_FILE).exists()
        for photo in self._read():
            self._remember(photo)
        self._append('')  # a launch is known from its start

    def __iter__(self) -> Iterator[SentPhoto]:
        """Iterate over the photographs that were kept, in their order.

        They are read again, because a camera may run for months.
        """
        return self._read()

    @property
    def any_sent(self) -> bool:
        """True if any photograph was sent."""
        return self.last is not None

    def claim(self, digest: str, name: str) -> str | None:
        """Return the name under which these bytes came before, None if they are new as `name`."""
        key = bytes.fromhex(digest)
        before = self._digests.get(key)
        self._digests.setdefault(key, name)
        return before

    def add(self, photo: SentPhoto) -> None:
        """Note a photograph; `keep` makes that last."""
        self._remember(photo)
        self._pending.append(photo)

    def keep(self) -> None:
        """Write the photographs that were added since the last call.

        Call it a moment after they were sent: a camera that is killed in between sends them again,
        which imaging notices, rather than never.
        """
        lines = ''.join(json.dumps(asdict(photo)) + '\n' for photo in self._pending)
        self._pending.clear()
        if lines:
            self._append(lines)

    def keep_baseline(self, stamp: float, data: bytes) -> None:
        """Keep the bytes of a baseline exposed at `stamp` [s]; only the last few stay."""
        if self._folder is None:
            return
        try:
            with whole_file(self._folder / f'baseline-{stamp:.6f}') as unfinished:
                unfinished.write_bytes(data)
            for old in self._baseline_paths()[:-MOST_BASELINES]:
                old.unlink()
        except OSError as error:
            self._note(error)

    def baselines(self) -> list[tuple[float, bytes]]:
        """Return stamp [s] and bytes of the baselines that were kept."""
        found = []
        for path in self._baseline_paths():
            try:
                found.append((float(path.name.removeprefix('baseline-')), path.read_bytes()))
            except (OSError, ValueError) as error:
                self._note(error)
        return found

    def _baseline_paths(self) -> list[Path]:
        return [] if self._folder is None else sorted(self._folder.glob('baseline-*'))

    def _remember(self, photo: SentPhoto) -> None:
        self.claim(photo.digest, photo.name)
        if photo.stamp is not None:
            self.last = photo

    def _read(self) -> Iterator[SentPhoto]:
        """Yield the photographs of the file; lines that cannot be read are left out."""
        if self._folder is None or not (self._folder / LINES_FILE).exists():
            return
        try:
            lines = (self._folder / LINES_FILE).read_bytes().splitlines()
        except OSError as error:
            self._note(error)
            return
        for line in filter(None, lines):
            photo = _photo_of(line)
            if photo is None:
                self.problem = (
                    f'{self._folder / LINES_FILE}: a line cannot be read and is left out; '
                    'a photograph may come twice'
                )
            else:
                yield photo

    def _append(self, lines: str) -> None:
        if self._folder is None:
            return
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with (self._folder / LINES_FILE).open('a', encoding='ascii') as file:
                # an interrupted write may have left a line without its end
                file.write('\n' + lines if lines else '')
        except OSError as error:
            self._note(error)

    def _note(self, error: Exception) -> None:
        self.problem = (
            f'{self._folder}: the camera cannot remember what it sent ({error}); after a restart '
            'it begins with the first photograph'
        )


def _photo_of(line: bytes) -> SentPhoto | None:
    """Return the photograph that a line describes, None if the line is damaged."""
    try:
        fields = json_value(line)
        mark = tuple(int(number) for number in fields['mark'])
        stamp = None if fields['stamp'] is None else float(fields['stamp'])
        name, digest, role = (str(fields[key]) for key in ('name', 'digest', 'role'))
        bytes.fromhex(digest)
        if any(abs(number) > sys.maxsize for number in mark):  # bytes and nanoseconds in 64 bits
            return None
        return SentPhoto(name, digest, mark, stamp, float(fields['correction']), role)
    except (ValueError, TypeError, KeyError, OverflowError):
        return None
