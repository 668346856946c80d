"""A folder that a camera writes to.

The folder is polled, because network shares report no changes. A photograph is sent once, when its
file is complete: its size has not changed between two polls, and it ends as its format requires. A
newer file waits for an older one that is still being written, but no longer than `patience`. A
protocol `imaging.csv` in the folder or its parent gives roles and times. If many files wait, only a
few are read per poll, in the order of exposure.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_imaging.exposure_time import HEADER_BYTES, exposure_time
from porotwin_imaging.photo_file import is_complete
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    PhotoProblem,
    Polled,
    SourceKind,
    SourceOption,
)
from porotwin_imaging.sources.photo_protocol import GrowingProtocol

SUFFIXES = frozenset({'.jpg', '.jpeg', '.png', '.tif', '.tiff'})
MOST_AT_ONCE = 4
"""Photographs per poll: limits the memory, and their topic has a queue of this length."""
PATIENCE_S = 10.0
"""Default patience [s]; a camera writes a file in less time."""
POLL_INTERVAL_S = 0.5
"""Time between two polls [s], short against the interval between photographs."""


@dataclass
class _WatchedFile:
    """A file that has not been sent yet.

    Attributes:
        size: size at the last poll [bytes].
        changed: time of its last change, from the file system [s].
        since: time of the first poll with this size and time of change, clock of the source [s].
        exposed: exposure time [s], None until it is needed.
        reported: True if a problem was reported; the file is ignored until it changes.
    """

    size: int
    changed: float
    since: float
    exposed: float | None = None
    reported: bool = False


class FolderSource:
    """Watches a folder for photographs.

    Args:
        folder: the folder; it must exist.
        patience: longest time [s] that a complete file waits for an unfinished older one. An
            unfinished file that has not grown for this time is reported.
        clock: returns the time of a steady clock [s].
        read_bytes: reads a file.

    Raises:
        InputError: there is no such folder.
    """

    def __init__(
        self,
        folder: Path | str,
        *,
        patience: float = PATIENCE_S,
        clock: Callable[[], float] = time.monotonic,
        read_bytes: Callable[[Path], bytes] = Path.read_bytes,
    ) -> None:
        self.folder = Path(folder)
        self._patience = patience
        self._clock = clock
        self._read_bytes = read_bytes
        self._watched: dict[str, _WatchedFile] = {}
        self._sent: set[str] = set()
        self._protocol = GrowingProtocol(self.folder)
        if not self.folder.is_dir():
            raise InputError(f'{folder}: no such folder; name the folder the camera writes to')

    def poll(self) -> Polled:
        """Return the photographs that are complete; see `CameraSource.poll`."""
        now = self._clock()
        changed, problems = self._protocol.refresh()
        if changed:
            for watched in self._watched.values():
                watched.exposed = None
        names = self._candidates(now)
        growing = [name for name in names if self._watched[name].since == now]
        due, undated = self._by_exposure([n for n in names if self._watched[n].since < now])
        complete, unfinished = self._read(due)
        unfinished += growing
        problems += [*undated, *self._stuck(unfinished, now)]
        released = self._released(complete, unfinished, now)
        return Polled([self._photo(name, data) for name, data in released], problems)

    def _candidates(self, now: float) -> list[str]:
        """Return the names of files that may be sent, and note when each last changed."""
        names = []
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    if not self._is_new_photo(entry.name):
                        continue
                    try:
                        status = entry.stat()
                    except OSError:  # removed again, or a broken link
                        continue
                    known = self._watched.get(entry.name)
                    now_is = (status.st_size, status.st_mtime)
                    if known is None or (known.size, known.changed) != now_is:
                        self._watched[entry.name] = _WatchedFile(*now_is, now)
                    if not self._watched[entry.name].reported:
                        names.append(entry.name)
        except OSError:  # a share that is away for a moment
            return []
        return names

    def _is_new_photo(self, name: str) -> bool:
        """Return whether a file is a photograph that was not sent yet."""
        visible = name not in self._sent and not name.startswith('.')
        return visible and Path(name).suffix.lower() in SUFFIXES

    def _by_exposure(self, names: list[str]) -> tuple[list[str], list[PhotoProblem]]:
        """Return `names` in the order of exposure; names with impossible times are problems."""
        dated, problems = [], []
        for name in names:
            try:
                self._exposed(name)
                dated.append(name)
            except InputError as error:
                self._watched[name].reported = True
                problems.append(PhotoProblem(name, f"photograph '{name}' left out: {error}"))
        return sorted(dated, key=self._exposed), problems

    def _exposed(self, name: str) -> float:
        """Return the exposure time [s] of a file, from its header or the protocol."""
        watched = self._watched[name]
        if watched.exposed is None:
            path = self.folder / name
            entry = self._protocol.entries.get(path.resolve())
            try:
                with path.open('rb') as file:
                    header = file.read(HEADER_BYTES)
            except OSError:  # reading the whole file will fail and be reported
                header = b''
            watched.exposed = exposure_time(header, entry.time if entry else None, watched.changed)
        return watched.exposed

    def _read(self, names: list[str]) -> tuple[dict[str, bytes], list[str]]:
        """Return the first complete files of `names`, and the incomplete ones before them."""
        complete: dict[str, bytes] = {}
        unfinished = []
        for name in names:
            if len(complete) == MOST_AT_ONCE:
                break
            data = self._complete(name)
            if data is None:
                unfinished.append(name)
            else:
                complete[name] = data
        return complete, unfinished

    def _complete(self, name: str) -> bytes | None:
        """Return the bytes of a file, None if it is not complete."""
        try:
            data = self._read_bytes(self.folder / name)
        except OSError:
            return None
        return data if len(data) == self._watched[name].size and is_complete(data) else None

    def _stuck(self, unfinished: list[str], now: float) -> list[PhotoProblem]:
        """Return problems for incomplete files that no longer grow."""
        problems = []
        for name in unfinished:
            watched = self._watched[name]
            if not watched.reported and now - watched.since >= self._patience:
                watched.reported = True
                reason = (
                    f"photograph '{name}' is truncated or broken: {watched.size} bytes, "
                    f'unchanged for {self._patience:g} s; copy it again'
                )
                problems.append(PhotoProblem(name, reason))
        return problems

    def _released(
        self, complete: dict[str, bytes], unfinished: list[str], now: float
    ) -> list[tuple[str, bytes]]:
        """Return the files that may be sent: none before older files that are still written."""
        growing = [self._watched[name] for name in unfinished if not self._watched[name].reported]
        oldest = min((watched.changed for watched in growing), default=float('inf'))
        released = []
        for name, data in complete.items():
            watched = self._watched[name]
            if watched.changed <= oldest or now - watched.since >= self._patience:
                released.append((name, data))
        return released

    def _photo(self, name: str, data: bytes) -> CameraPhoto:
        """Return the photograph and forget its file.

        With a protocol, files that it does not name are states.
        """
        entry = self._protocol.entries.get((self.folder / name).resolve())
        role = entry.role if entry else ('state' if self._protocol.entries else None)
        photo = CameraPhoto(data, self._exposed(name), name, role)
        self._sent.add(name)
        del self._watched[name]
        return photo


SOURCE = SourceKind(
    name='folder',
    address='folder that the camera writes to',
    open=FolderSource,
    options=(SourceOption('patience', PATIENCE_S, 'wait for a file still being written [s]'),),
    poll_interval_s=POLL_INTERVAL_S,
)
