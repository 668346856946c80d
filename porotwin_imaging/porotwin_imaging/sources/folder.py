"""A folder that a camera writes to.

The folder is polled, because network shares report no changes. A photograph is sent once, when its
file is complete: its size has not changed between two polls, and it ends as its format requires. A
newer file waits for an older one that is still being written, but no longer than `patience`. A
protocol `imaging.csv` in the folder or its parent gives roles and times. If many files wait, only a
few are read per poll, in the order of exposure.

A name that is used again with new content is a new photograph. A file that changes without new
content is not.
"""

import errno
import os
import stat
import struct
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import PHOTO_SUFFIXES, PhotoLine
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.remark import Remark
from porotwin_core.clock.stamps import steady_time, steady_time_of
from porotwin_imaging.photograph.exposure_time import HEADER_BYTES, exif_time
from porotwin_imaging.photograph.file_names import natural_order, printable
from porotwin_imaging.photograph.photo_clock import TimeEvidence, Trust, own_time
from porotwin_imaging.photograph.photo_file import (
    MOST_BYTES,
    TIFF_STARTS,
    is_complete,
    is_photograph,
)
from porotwin_imaging.photograph.sent_photos import FileMark, SentPhoto, digest_of
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    Polled,
    SourceKind,
    SourceOption,
)
from porotwin_imaging.sources.photo_protocol import GrowingProtocol

UNREAD_SUFFIXES = frozenset(
    {'.arw', '.cr2', '.cr3', '.dng', '.heic', '.nef', '.orf', '.raf', '.raw', '.rw2'}
)
"""Suffixes of raw photographs and of formats that OpenCV does not read."""
UNREAD = (
    'it and others like it are not read; set the camera to JPEG, or to JPEG beside its own format'
)
MOST_AT_ONCE = 4
"""Photographs per poll: limits the memory, and their topic has a queue of this length."""
PATIENCE_S = 10.0
"""Default patience [s]; a camera writes a file in less time. A file is seen to arrive if the last
look was at most this long ago."""
POLL_INTERVAL_S = 0.5
"""Time between two polls [s], short against the interval between photographs."""
_MARK_NUMBERS = 3


@dataclass
class _WatchedFile:
    """A file that has not been sent yet.

    Attributes:
        mark: size and times of change at the last poll.
        since: time of the first poll with this mark, clock of the source [s].
        arrival: the same moment by a steady clock [s since 1970].
        watched: True if the file arrived while the source looked.
        evidence: the known facts about its time, None until they are needed.
        reported: True if a problem was reported; the file is ignored until it changes.
        fault: why the file could not be read, empty if it is unfinished.
    """

    mark: FileMark
    since: float
    arrival: float
    watched: bool
    evidence: TimeEvidence | None = None
    reported: bool = False
    fault: str = ''


class FolderSource:
    """Watches a folder for photographs.

    Args:
        folder: the folder; while it is missing, the camera is absent.
        patience: longest time [s] that a complete file waits for an unfinished older one. An
            unfinished file that has not grown for this time is reported.
        clock: returns the time of a steady clock [s].
        now: returns the time of a steady clock [s since 1970].
        read_bytes: reads a file.

    Attributes:
        trust: the first time of a photograph that may be believed; the times give the order.
    """

    def __init__(
        self,
        folder: Path | str,
        *,
        patience: float = PATIENCE_S,
        clock: Callable[[], float] = time.monotonic,
        now: Callable[[], float] = steady_time,
        read_bytes: Callable[[Path], bytes] | None = None,
    ) -> None:
        self.folder = Path(folder)
        self.trust: Trust = 'exif'
        self._patience = patience
        self._clock = clock
        self._now = now
        self._read_bytes = read_bytes or read_regular
        self._watched: dict[str, _WatchedFile] = {}
        self._sent: dict[str, tuple[bytes, bytes]] = {}
        """Packed mark and digest of the photographs that were sent, by name."""
        self._told: set[str] = set()
        """Names and suffixes that are no photographs, each reported once."""
        self._looked: float | None = None
        self._protocol = GrowingProtocol(self.folder)

    def resume(self, sent: Iterable[SentPhoto]) -> None:
        """Take note of the photographs that were sent before a restart."""
        for photo in sent:
            if len(photo.mark) == _MARK_NUMBERS:
                self._sent[photo.name] = (_packed(photo.mark), bytes.fromhex(photo.digest))

    def poll(self) -> Polled:
        """Return the photographs that are complete; see `CameraSource.poll`."""
        now = self._clock()
        changed, problems = self._protocol.refresh()
        if changed:
            for watched in self._watched.values():
                watched.evidence = None
        try:
            names, strange = self._candidates(now)
        except OSError as error:  # a share that is away
            reason = f'folder {printable(str(self.folder))} does not answer: {error.strerror}'
            return Polled([], problems, absent=reason)
        growing = [name for name in names if self._watched[name].since == now]
        due, undated = self._by_exposure([n for n in names if self._watched[n].since < now])
        complete, unfinished = self._read(due)
        unfinished += growing
        problems += [*strange, *undated, *self._stuck(unfinished, now)]
        released = self._released(complete, unfinished, now)
        waiting = len(due)
        photos = [
            self._photo(name, data, waiting - n) for n, (name, data) in enumerate(released, 1)
        ]
        found = [photo for photo in photos if photo is not None]
        return Polled(found, problems, arriving=bool(growing))

    def _candidates(self, now: float) -> tuple[list[str], list[Remark]]:
        """Return the names of files that may be sent, and problems; note when each last changed.

        Raises:
            OSError: the folder cannot be listed.
        """
        names: list[str] = []
        listed: set[str] = set()
        problems: list[Remark] = []
        watched = self._looked is not None and now - self._looked <= PATIENCE_S
        arrival = self._now()
        with os.scandir(self.folder) as entries:
            for entry in entries:
                suffix = Path(entry.name).suffix.lower()
                if entry.name.startswith('.'):
                    continue
                if suffix in UNREAD_SUFFIXES:
                    problems += self._tell(suffix, entry.name, UNREAD)
                if suffix not in PHOTO_SUFFIXES:
                    continue
                fault, mark = _mark_of(entry)
                if mark is None:
                    problems += self._tell(entry.name, entry.name, fault)
                    continue
                sent = self._sent.get(entry.name)
                if sent is not None and sent[0] == _packed(mark):
                    continue
                known = self._watched.get(entry.name)
                if known is None or known.mark != mark:
                    self._watched[entry.name] = _WatchedFile(mark, now, arrival, watched)
                listed.add(entry.name)
                if not self._watched[entry.name].reported:
                    names.append(entry.name)
        self._looked = now
        for gone in set(self._watched) - listed:
            del self._watched[gone]
        return names, problems

    def _tell(self, key: str, name: str, fault: str) -> list[Remark]:
        """Return the problem of a file that is no photograph, the first time."""
        if not fault or key in self._told:
            return []
        self._told.add(key)
        why, _, remedy = fault.partition('; ')
        return [Remark(name, '', why, remedy, code='no_photograph')]

    def _by_exposure(self, names: list[str]) -> tuple[list[str], list[Remark]]:
        """Return `names` in the order of exposure, and problems.

        A file without a believable time follows the file whose name comes before its own.
        """
        problems: list[Remark] = []
        order: dict[str, float] = {}
        before = -float('inf')
        for name in sorted(names, key=natural_order):
            if self._watched[name].evidence is None:
                self._watched[name].evidence, found = self._evidence(name)
                problems += found
            evidence = self._watched[name].evidence
            assert evidence is not None
            own = own_time(evidence, self.trust)
            before = before if own is None else own
            order[name] = before
        return sorted(order, key=lambda name: order[name]), problems

    def _evidence(self, name: str) -> tuple[TimeEvidence, list[Remark]]:
        """Return the times of a file, and problems."""
        watched = self._watched[name]
        problems = []
        exif = None
        try:
            data = read_regular(self.folder / name, HEADER_BYTES)
            if data.startswith(TIFF_STARTS):
                data = read_regular(self.folder / name)
            exif = exif_time(data)
        except OSError:  # reading the whole file will fail and be reported
            pass
        except InputError as error:
            problems.append(Remark(name, '', str(error), '', code='wrong_exif_time'))
        entries = self._protocol.entries
        entry = self._entry(name)
        return TimeEvidence(
            printable(name),
            watched.arrival,
            exif=exif,
            protocol=entry.time if entry else None,
            protocol_end=max((one.time for one in entries.values()), default=0.0),
            file=steady_time_of(watched.mark[1] / 1e9, watched.arrival),
            watched=watched.watched,
        ), problems

    def _entry(self, name: str) -> PhotoLine | None:
        """Return the entry of a file in the protocol, None if there is none."""
        try:
            return self._protocol.entries.get((self.folder / name).resolve())
        except (OSError, RuntimeError):  # a loop of links
            return None

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
        """Return the bytes of a file, None if it is not complete or cannot be read."""
        watched = self._watched[name]
        if watched.mark[0] > MOST_BYTES:
            watched.fault = f'has {watched.mark[0] / 1e6:.0f} MB: no photograph'
            return None
        try:
            data = self._read_bytes(self.folder / name)
        except OSError as error:
            watched.fault = f'cannot be read: {error.strerror}'
            return None
        except InputError as error:
            watched.fault = f'cannot be read: {error}'
            return None
        watched.fault = ''
        if data and not is_photograph(data):
            watched.fault = 'is no JPEG, PNG or TIFF, whatever its name says'
        return data if len(data) == watched.mark[0] and is_complete(data) else None

    def _stuck(self, unfinished: list[str], now: float) -> list[Remark]:
        """Return problems for incomplete files that no longer grow."""
        problems = []
        for name in unfinished:
            watched = self._watched[name]
            if not watched.reported and now - watched.since >= self._patience:
                watched.reported = True
                fault = watched.fault or (
                    f'is truncated or broken: {watched.mark[0]} bytes, unchanged for '
                    f'{self._patience:g} s'
                )
                code = 'unreadable' if watched.fault else 'truncated'
                problems.append(
                    Remark(name, '', f'the photograph {fault}', 'copy it again', code=code)
                )
        return problems

    def _released(
        self, complete: dict[str, bytes], unfinished: list[str], now: float
    ) -> list[tuple[str, bytes]]:
        """Return the files that may be sent: none before older files that are still written."""
        growing = [self._watched[name] for name in unfinished if not self._watched[name].reported]
        oldest = min((watched.mark[1] for watched in growing), default=float('inf'))
        released = []
        for name, data in complete.items():
            watched = self._watched[name]
            if watched.mark[1] <= oldest or now - watched.since >= self._patience:
                released.append((name, data))
        return released

    def _photo(self, name: str, data: bytes, waiting: int) -> CameraPhoto | None:
        """Return the photograph and forget its file; None if its content was sent already.

        With a protocol, files that it does not name are states. Its dilutions are for calibrations.
        """
        watched = self._watched.pop(name)
        digest = bytes.fromhex(digest_of(data))
        before = self._sent.get(name)
        self._sent[name] = (_packed(watched.mark), digest)
        if before is not None and before[1] == digest:
            return None
        entry = self._entry(name)
        role = entry.role if entry else ('state' if self._protocol.entries else None)
        if role == 'dilution':
            return None
        assert watched.evidence is not None
        evidence = replace(watched.evidence, waiting=waiting)
        return CameraPhoto(data, watched.arrival, name, role, evidence, watched.mark)


def _mark_of(entry: os.DirEntry[str]) -> tuple[str, FileMark | None]:
    """Return the mark of a regular file, otherwise None with the fault, empty if it is gone."""
    try:
        status = entry.stat()
    except OSError as error:
        fault = f'it cannot be looked at: {error.strerror}'
        return fault if entry.is_symlink() or error.errno != errno.ENOENT else '', None
    if not stat.S_ISREG(status.st_mode):
        kind = 'folder' if stat.S_ISDIR(status.st_mode) else 'FIFO, socket or device'
        return f'it is a {kind}, no photograph; move it away', None
    return '', (status.st_size, status.st_mtime_ns, status.st_ctime_ns)


def _packed(mark: tuple[int, ...]) -> bytes:
    """Return a mark as bytes, which take less memory; a folder may hold years of photographs."""
    return struct.pack('<3q', *mark)


def check_folder(address: str) -> None:
    """Check the folder of photographs.

    Raises:
        InputError: there is no such folder, or it may not be listed.
    """
    named = printable(address)
    if not Path(address).is_dir():
        raise InputError(f'{named}: no such folder; name the folder the camera writes to')
    if not os.access(address, os.R_OK | os.X_OK):
        raise InputError(f'{named}: may not be read; allow this user to read the folder')


SOURCE = SourceKind(
    name='folder',
    address='folder that the camera writes to',
    open=FolderSource,
    check=check_folder,
    options=(
        SourceOption(
            'patience', PATIENCE_S, 'wait for a file still being written [s]', 0.0, 3600.0
        ),
    ),
    poll_interval_s=POLL_INTERVAL_S,
)
