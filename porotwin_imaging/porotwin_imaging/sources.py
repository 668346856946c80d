"""Where photographs come from: a folder that is watched, or a camera on USB.

A folder is polled, since network shares report nothing. A photograph is sent once, when it is
whole: its size has not changed between two looks and it ends as its format says. While an older
file is still being written a newer one waits for it, but no longer than `patience`. A protocol
`imaging.csv` (time_s, path, role) in the folder or above it gives roles and times; without it the
first photograph of a session that shows something is the baseline. Of a backlog only a few are read
at one look, in the order of their exposure.
"""

import csv
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol, cast, get_args

import cv2

from porotwin_core.errors import InputError
from porotwin_imaging.exposure import HEADER_BYTES, exposure_time
from porotwin_imaging.photograph import decode, is_whole

Role = Literal['baseline', 'state']
SUFFIXES = frozenset({'.jpg', '.jpeg', '.png', '.tif', '.tiff'})
PROTOCOL = 'imaging.csv'
MOST_AT_ONCE = 4
"""Photographs of one look at a folder: no more are in memory, and their topic keeps them all."""


@dataclass(frozen=True)
class Photo:
    """A photograph as the camera wrote it, with its exposure `time` [s], `role` and `name`."""

    data: bytes
    time: float
    role: Role
    name: str


@dataclass(frozen=True)
class Problem:
    """A file that cannot be sent, and why, in one line."""

    name: str
    reason: str


class Source(Protocol):
    """Gives the photographs that have come since it was last asked."""

    def poll(self) -> tuple[list[Photo], list[Problem]]:
        """Return new photographs in the order of their exposure, and files in trouble."""
        ...


def read_protocol(path: Path) -> dict[Path, tuple[float, Role]]:
    """Return time [s] and role of every file that the protocol `path` names.

    Raises:
        InputError: a line is not `time_s,path,role`, or the file is no text in UTF-8.
    """
    lines: dict[Path, tuple[float, Role]] = {}
    try:
        with path.open(encoding='utf-8-sig', newline='') as file:
            for line in csv.DictReader(file, skipinitialspace=True):
                place, told = _protocol_line(path, line)
                lines[place] = told
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: not readable ({error}); save it as CSV in UTF-8') from None
    return lines


def _protocol_line(path: Path, line: dict[str, str]) -> tuple[Path, tuple[float, Role]]:
    try:
        time, role = float(line['time_s']), line['role']
        if role not in get_args(Role) or not math.isfinite(time):
            raise ValueError
        return (path.parent / line['path']).resolve(), (time, cast(Role, role))
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f'{path}: cannot read {dict(line)}; write time_s,path,role with a finite number and '
            'role baseline or state'
        ) from None


def _as_baseline(photo: Photo) -> Photo:
    """Return the first photograph of a session as its baseline.

    Raises:
        InputError: it is broken, black or over-exposed.
    """
    try:
        decode(photo.data, 8)
    except InputError as error:
        raise InputError(
            f"photograph '{photo.name}' cannot be the baseline, the next one is tried: {error}"
        ) from None
    return replace(photo, role='baseline')


@dataclass
class _Watched:
    size: int
    changed: float
    since: float
    """When it was first seen with this size and time of change (the clock of `Folder`)."""
    exposed: float | None = None
    """When it was exposed [s], once that was asked for."""
    reported: bool = False


class Folder:
    """Watches `folder` for photographs.

    `patience` [s]: how long a whole file waits for an older one still being written, and after how
    long an unfinished file that no longer grows is reported. `clock` is for tests.
    """

    def __init__(
        self,
        folder: Path | str,
        *,
        patience: float = 10.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder = Path(folder)
        self._patience = patience
        self._clock = clock
        self._watched: dict[str, _Watched] = {}
        self._sent: set[str] = set()
        self._baseline_sent = False
        self._protocol_stamp: tuple[Path, int, int] | None = None
        self._protocol: dict[Path, tuple[float, Role]] = {}
        if not self.folder.is_dir():
            raise InputError(f'{folder}: no such folder; name the folder the camera writes to')

    def poll(self) -> tuple[list[Photo], list[Problem]]:
        """Look once; cheap when nothing has changed. See `Source.poll`."""
        now = self._clock()
        problems = self._read_protocol()
        names = self._look(now)
        growing = [n for n in names if self._watched[n].since == now]
        due, undated = self._by_exposure([n for n in names if self._watched[n].since < now])
        whole, unfinished = self._read(due)
        unfinished += growing
        problems += [*undated, *self._stuck(unfinished, now)]
        photos = [self._photo(name, data) for name, data in self._released(whole, unfinished, now)]
        photos, refused = self._with_baseline(photos)
        return photos, problems + refused

    def _look(self, now: float) -> list[str]:
        """Return the names of files that may be sent, and note when each last changed."""
        names = []
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    if entry.name in self._sent or entry.name.startswith('.'):
                        continue
                    if Path(entry.name).suffix.lower() not in SUFFIXES:
                        continue
                    try:
                        status = entry.stat()
                    except OSError:  # gone again, or a link that leads nowhere
                        continue
                    known = self._watched.get(entry.name)
                    if known is None or (known.size, known.changed) != (
                        status.st_size,
                        status.st_mtime,
                    ):
                        self._watched[entry.name] = _Watched(status.st_size, status.st_mtime, now)
                    if not self._watched[entry.name].reported:
                        names.append(entry.name)
        except OSError:  # a share that is away for a moment: look again next time
            return []
        return names

    def _by_exposure(self, names: list[str]) -> tuple[list[str], list[Problem]]:
        """Return `names` in the order of exposure, without those that have no time that can be."""
        dated, problems = [], []
        for name in names:
            try:
                self._exposed(name)
                dated.append(name)
            except InputError as error:
                self._watched[name].reported = True
                problems.append(Problem(name, f"photograph '{name}' left out: {error}"))
        return sorted(dated, key=self._exposed), problems

    def _exposed(self, name: str) -> float:
        watched = self._watched[name]
        if watched.exposed is None:
            told = self._protocol.get((self.folder / name).resolve())
            try:
                with (self.folder / name).open('rb') as file:
                    header = file.read(HEADER_BYTES)
            except OSError:  # reading the whole of it will fail and be told
                header = b''
            watched.exposed = exposure_time(header, told[0] if told else None, watched.changed)
        return watched.exposed

    def _read(self, names: list[str]) -> tuple[dict[str, bytes], list[str]]:
        """Return the first whole files of `names`, and those before them that are not whole."""
        whole: dict[str, bytes] = {}
        unfinished = []
        for name in names:
            if len(whole) == MOST_AT_ONCE:
                break
            data = self._whole(name)
            if data is None:
                unfinished.append(name)
            else:
                whole[name] = data
        return whole, unfinished

    def _whole(self, name: str) -> bytes | None:
        try:
            data = (self.folder / name).read_bytes()
        except OSError:
            return None
        return data if len(data) == self._watched[name].size and is_whole(data) else None

    def _stuck(self, unfinished: list[str], now: float) -> list[Problem]:
        problems = []
        for name in unfinished:
            watched = self._watched[name]
            if not watched.reported and now - watched.since >= self._patience:
                watched.reported = True
                problems.append(
                    Problem(
                        name,
                        f"photograph '{name}' is truncated or broken: {watched.size} bytes, "
                        f'unchanged for {self._patience:g} s; copy it again',
                    )
                )
        return problems

    def _released(
        self, whole: dict[str, bytes], unfinished: list[str], now: float
    ) -> list[tuple[str, bytes]]:
        """Return what may go now: not before older files that are still being written."""
        growing = [self._watched[name] for name in unfinished if not self._watched[name].reported]
        oldest = min((watched.changed for watched in growing), default=float('inf'))
        released = []
        for name, data in whole.items():
            watched = self._watched[name]
            if watched.changed <= oldest or now - watched.since >= self._patience:
                released.append((name, data))
        return released

    def _photo(self, name: str, data: bytes) -> Photo:
        """Return the photograph, which is not looked at again."""
        told = self._protocol.get((self.folder / name).resolve())
        photo = Photo(data, self._exposed(name), told[1] if told else 'state', name)
        self._sent.add(name)
        del self._watched[name]
        return photo

    def _with_baseline(self, photos: list[Photo]) -> tuple[list[Photo], list[Problem]]:
        """Make the first photograph of a session without a protocol its baseline, if it can be."""
        problems = []
        while photos and not self._protocol and not self._baseline_sent:
            try:
                photos[0] = _as_baseline(photos[0])
                self._baseline_sent = True
            except InputError as error:
                problems.append(Problem(photos.pop(0).name, str(error)))
        self._baseline_sent = self._baseline_sent or bool(photos)
        return photos, problems

    def _read_protocol(self) -> list[Problem]:
        for path in (self.folder / PROTOCOL, self.folder.parent / PROTOCOL):
            try:
                status = path.stat()
                stamp = (path, status.st_mtime_ns, status.st_size)
                if stamp != self._protocol_stamp:
                    self._protocol_stamp = stamp
                    self._protocol = read_protocol(path)
                    for watched in self._watched.values():
                        watched.exposed = None
            except InputError as error:
                return [Problem(PROTOCOL, str(error))]
            except OSError:
                continue
            break
        return []


class Device:
    """A USB or V4L camera through OpenCV, one photograph for every `poll`, encoded as JPEG.

    `device` is a number or a path such as /dev/video0; `width`, `height` are asked of the camera
    [px]. The first photograph that shows something is the baseline. A camera that gives no picture
    is opened again. `clock` gives the exposure time [s].
    """

    def __init__(
        self,
        device: int | str,
        *,
        width: int = 0,
        height: int = 0,
        quality: int = 95,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._name = str(device)
        self._quality = quality
        self._clock = clock
        self._count = 0
        self._baseline_taken = False
        self._size = (width, height)
        self._camera = self._opened()
        if not self._camera.isOpened():
            raise InputError(f"camera '{device}' cannot be opened; see which /dev/video* exist")

    def _opened(self) -> cv2.VideoCapture:
        name, (width, height) = self._name, self._size
        camera = cv2.VideoCapture(int(name) if name.isdigit() else name)
        camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if width and height:
            camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        return camera

    def poll(self) -> tuple[list[Photo], list[Problem]]:
        """Take a photograph now. See `Source.poll`."""
        self._camera.grab()  # drops a frame that was waiting in the driver
        moment = self._clock()
        taken, pixels = self._camera.read()
        if not taken:
            # one that was unplugged answers again only when opened again
            self._camera.release()
            self._camera = self._opened()
            return [], [Problem(self._name, f"camera '{self._name}' gave no picture; check it")]
        encoded, data = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, self._quality])
        if not encoded:
            return [], [Problem(self._name, f"camera '{self._name}': picture cannot be encoded")]
        self._count += 1
        photo = Photo(data.tobytes(), moment, 'state', f'{self._name}-{self._count:06d}.jpg')
        if self._baseline_taken:
            return [photo], []
        try:
            photo = _as_baseline(photo)
        except InputError as error:
            return [], [Problem(photo.name, str(error))]
        self._baseline_taken = True
        return [photo], []

    def close(self) -> None:
        """Let go of the camera."""
        self._camera.release()
