"""A watched folder gives complete files, once and in order."""

import io
import os
import shutil
import socket
import struct
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular
from porotwin_imaging.camera.photo_forwarding import PhotoForwarder
from porotwin_imaging.photograph.exposure_time import HEADER_BYTES
from porotwin_imaging.photograph.sent_photos import SentPhotos
from porotwin_imaging.sources.camera_source import CameraPhoto
from porotwin_imaging.sources.folder import (
    MOST_AT_ONCE,
    FolderSource,
    check_folder,
)

GENERATOR = np.random.default_rng(2)
BEGIN = 1.7e9
"""Time of the first file [s since 1970]."""
INTERVAL = 30.0
JUST_NOW = 1e4
NOW = BEGIN + INTERVAL * JUST_NOW
"""Start of the clock [s since 1970], after all other files."""


def jpeg() -> bytes:
    pixels = GENERATOR.integers(0, 255, (40, 60, 3), dtype=np.uint8)
    return cv2.imencode('.jpg', pixels)[1].tobytes()


class WatchedFolder:
    """A folder beside a camera node with a clock that advances half a second per poll.

    Attributes:
        path: the folder.
        problems: all problems so far: name and code.
        times: stamps of the photographs by name.
        after_reading: called with each file that the source has read.
    """

    def __init__(self, path: Path, progress: Path | None = None) -> None:
        self.path = path
        self.problems: list[tuple[str, str]] = []
        self.times: dict[str, float] = {}
        self.after_reading: Callable[[Path], None] = lambda _: None
        self._progress = progress
        self._now = 0.0
        self._found: list[tuple[str, str | None]] = []
        self.start()

    def start(self) -> None:
        """Start the camera node, or start it again."""
        source = FolderSource(
            self.path,
            patience=5.0,
            clock=lambda: self._now,
            now=lambda: NOW + self._now,
            read_bytes=self._read,
        )
        self.forwarder = PhotoForwarder(
            source,
            send=self._send,
            report=lambda problem: self.problems.append((problem.key, problem.code)),
            say=lambda _: None,
            sent=SentPhotos(self._progress),
            interval_s=INTERVAL,
        )

    def _read(self, path: Path) -> bytes:
        data = read_regular(path)
        self.after_reading(path)
        return data

    def _send(self, photo: CameraPhoto) -> None:
        self._found.append((photo.name, photo.role))
        self.times[photo.name] = photo.time

    def poll(self, times: int = 1) -> list[tuple[str, str | None]]:
        """Return names and roles of the new photographs."""
        self._found = []
        for _ in range(times):
            self._now += 0.5
            self.forwarder.forward()
        return self._found

    def put(self, name: str, data: bytes, age: float = 0.0) -> None:
        """Write a photograph with the file time of photograph number `age`."""
        (self.path / name).write_bytes(data)
        self.touch(name, age)

    def touch(self, name: str, age: float) -> None:
        os.utime(self.path / name, (BEGIN + INTERVAL * age, BEGIN + INTERVAL * age))


@pytest.fixture
def folder(tmp_path) -> WatchedFolder:
    return WatchedFolder(tmp_path)


def test_each_photograph_comes_once_and_the_first_is_the_baseline(folder) -> None:
    folder.put('b.jpg', jpeg(), age=2)
    folder.put('a.jpg', jpeg(), age=1)
    folder.put('notes.txt', b'no photograph')
    assert folder.poll(3) == [('a.jpg', 'baseline'), ('b.jpg', 'state')]
    folder.put('c.png', cv2.imencode('.png', np.zeros((9, 9, 3), np.uint8))[1].tobytes(), age=3)
    assert folder.poll(3) == [('c.png', 'state')]
    folder.touch('a.jpg', age=9)
    assert folder.poll(3) == []
    assert folder.problems == []


def test_a_black_or_over_exposed_photograph_is_no_baseline(folder) -> None:
    for age, level in enumerate((0, 255, 90)):
        grey = np.full((64, 96, 3), level, np.uint8)
        folder.put(f'{age + 1}.jpg', cv2.imencode('.jpg', grey)[1].tobytes(), age)
    folder.put('4.jpg', jpeg(), age=4)
    assert folder.poll(3) == [('3.jpg', 'baseline'), ('4.jpg', 'state')]
    assert folder.problems == [('1.jpg', 'no_baseline'), ('2.jpg', 'no_baseline')]


def test_a_file_that_is_written_slowly_comes_when_it_is_complete(folder) -> None:
    data = jpeg()
    for end in range(100, len(data), 400):
        folder.put('slow.jpg', data[:end], age=end)
        assert folder.poll() == []
    folder.put('slow.jpg', data, age=JUST_NOW)
    assert folder.poll(2) == [('slow.jpg', 'baseline')]


def test_a_source_tells_that_a_photograph_arrives(tmp_path) -> None:
    now = 0.0
    source = FolderSource(tmp_path, clock=lambda: now)
    assert not source.poll().arriving
    (tmp_path / 'a.jpg').write_bytes(jpeg())
    assert source.poll().arriving
    now = 0.1
    assert not source.poll().arriving


def test_a_newer_file_waits_for_an_older_one_for_a_limited_time(folder) -> None:
    data = jpeg()
    folder.put('1.jpg', data[:500], age=1)
    folder.put('2.jpg', jpeg(), age=2)
    assert folder.poll(4) == []
    folder.put('1.jpg', data, age=1)
    assert folder.poll(2) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    data = jpeg()
    folder.put('3.jpg', data[:500], age=3)
    folder.put('4.jpg', jpeg(), age=4)
    assert folder.poll(30) == [('4.jpg', 'state')]
    assert folder.problems == [('3.jpg', 'truncated')]
    folder.put('3.jpg', data, age=5)
    assert folder.poll(2) == [('3.jpg', 'state')]


def test_the_protocol_gives_roles_and_times_and_may_grow(tmp_path) -> None:
    photos = tmp_path / 'photos'
    photos.mkdir()
    folder = WatchedFolder(photos)
    protocol = tmp_path / 'imaging.csv'
    protocol.write_text('time_s,path,role\n0,photos/x.jpg,baseline\n30,photos/a.jpg,state\n')
    folder.put('a.jpg', jpeg())
    folder.put('x.jpg', jpeg(), age=1)
    assert folder.poll(3) == [('x.jpg', 'baseline'), ('a.jpg', 'state')]
    protocol.write_text(protocol.read_text() + '60,photos/b.jpg,baseline\n')
    folder.put('b.jpg', jpeg(), age=JUST_NOW)
    assert folder.poll(3) == [('b.jpg', 'baseline')]


def test_a_faulty_protocol_is_reported_and_photographs_still_come(folder) -> None:
    protocol = folder.path / 'imaging.csv'
    protocol.write_bytes('time_s,path,role\n0,größe.jpg,baseline\n'.encode('cp1252'))
    folder.put('a.jpg', jpeg())
    assert folder.poll(3) == [('a.jpg', 'baseline')]
    protocol.write_text('time_s,path,role\nnan,a.jpg,state\n')
    folder.put('b.jpg', jpeg(), age=1)
    assert folder.poll(3) == [('b.jpg', 'state')]
    assert folder.problems == [('imaging.csv', 'wrong_protocol')] * 2


def dated(original: str, offset: str) -> bytes:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: original, 0x9011: offset})
    file = io.BytesIO()
    Image.new('RGB', (30, 20), (90, 90, 90)).save(file, 'JPEG', exif=exif)
    return file.getvalue()


def test_a_photograph_with_an_impossible_exif_time_gets_its_file_time(folder) -> None:
    folder.put('1.jpg', dated('2021:09:03 14:05:06', '+99:00'), age=1)
    folder.put('2.jpg', dated('0001:01:01 00:00:00', ''), age=2)
    folder.put('3.jpg', dated('2001:01:01 00:00:00', '+00:00'), age=3)
    assert [name for name, _ in folder.poll(5)] == ['1.jpg', '2.jpg', '3.jpg']
    assert list(folder.times.values()) == [BEGIN + 30, BEGIN + 60, BEGIN + 90]
    wrong = [('1.jpg', 'wrong_exif_time'), ('2.jpg', 'wrong_exif_time'), ('3.jpg', 'time')]
    assert folder.problems == wrong


def test_the_exif_time_at_the_end_of_a_tiff_counts(folder) -> None:
    exif = Image.Exif()
    exif[0x8769] = details = exif.get_ifd(0x8769)
    details.update({0x9003: '2021:09:03 14:05:06', 0x9011: '+00:00'})
    file = io.BytesIO()
    Image.new('RGB', (400, 300), (90, 90, 90)).save(file, 'TIFF', exif=exif)
    data = file.getvalue()
    assert len(data) > HEADER_BYTES
    (first,) = struct.unpack_from('<I', data, 4)
    (count,) = struct.unpack_from('<H', data, first)
    directory = data[first : first + 2 + 12 * count + 4]
    folder.put('a.tif', data[:4] + struct.pack('<I', len(data)) + data[8:] + directory)
    folder.poll(3)
    assert folder.times['a.tif'] == datetime(2021, 9, 3, 14, 5, 6, tzinfo=UTC).timestamp()


def test_an_exif_time_that_is_not_trusted_gives_no_order(folder) -> None:
    folder.put('1.jpg', dated('2021:09:03 14:05:06', '+00:00'), age=1)
    folder.put('2.jpg', dated('2021:09:02 14:05:06', '+00:00'), age=2)  # with a new battery
    folder.forwarder.trust = 'file'
    assert [name for name, _ in folder.poll(5)] == ['1.jpg', '2.jpg']
    assert list(folder.times.values()) == [BEGIN + 30, BEGIN + 60]
    assert folder.problems == []


def test_a_photograph_that_is_removed_after_reading_is_sent(folder) -> None:
    folder.put('1.jpg', jpeg(), age=1)
    folder.put('2.jpg', jpeg(), age=2)

    def remove(path: Path) -> None:
        if path.name == '1.jpg':
            path.unlink()

    folder.after_reading = remove
    assert folder.poll(3) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    assert folder.problems == []


def test_names_that_are_no_photographs_cost_one_line_each(folder) -> None:
    (folder.path / '0.jpg').symlink_to(folder.path / 'nowhere.jpg')
    (folder.path / 'loop.jpg').symlink_to(folder.path / 'loop.jpg')
    (folder.path / 'folder.jpg').mkdir()
    (folder.path / 'raw.CR2').write_bytes(b'raw')
    (folder.path / 'more.CR2').write_bytes(b'raw')
    os.mkfifo(folder.path / 'fifo.jpg')
    with socket.socket(socket.AF_UNIX) as connection:
        connection.bind(str(folder.path / 'socket.jpg'))
    (folder.path / 'device.jpg').symlink_to('/dev/zero')
    (folder.path / 'text.jpg').write_bytes(b'no picture')
    (folder.path / 'empty.jpg').write_bytes(b'')
    folder.put('1.jpg', jpeg())
    folder.put('sparse.jpg', b'')
    os.truncate(folder.path / 'sparse.jpg', 10**12)
    assert folder.poll(40) == [('1.jpg', 'baseline')]
    told = sorted(name for name, _ in folder.problems)
    raw = 'more.CR2' if 'more.CR2' in told else 'raw.CR2'
    strange = '0.jpg loop.jpg folder.jpg fifo.jpg socket.jpg device.jpg text.jpg empty.jpg'
    assert told == sorted([*strange.split(), 'sparse.jpg', raw])
    folder.put('empty.jpg', jpeg(), age=1)
    assert folder.poll(2) == [('empty.jpg', 'state')]


def test_a_name_that_is_no_utf_8_is_a_photograph(folder) -> None:
    for number, name in enumerate((b'\xff\xfe.jpg', b'a\nb.jpg', b'x' * 251 + b'.jpg')):
        folder.put(os.fsdecode(name), jpeg(), age=number)
    folder.put(os.fsdecode(b'\xe9.jpg'), jpeg()[:500], age=4)
    assert len(folder.poll(20)) == 3
    assert folder.problems == [(r'\xe9.jpg', 'truncated')]


def test_a_file_without_permission_comes_when_it_may_be_read(folder) -> None:
    folder.put('1.jpg', jpeg())

    def forbid(path: Path) -> None:
        raise PermissionError(13, 'Permission denied')

    folder.after_reading = forbid
    assert folder.poll(20) == []
    assert folder.problems == [('1.jpg', 'unreadable')]
    folder.after_reading = lambda _: None
    (folder.path / '1.jpg').chmod(0o600)
    assert folder.poll(2) == [('1.jpg', 'baseline')]


def test_a_name_used_again_is_a_new_photograph_and_a_touched_file_is_not(folder) -> None:
    first = jpeg()
    folder.put('latest.jpg', first)
    assert folder.poll(2) == [('latest.jpg', 'baseline')]
    folder.touch('latest.jpg', age=1)
    assert folder.poll(3) == []
    folder.put('latest.jpg', jpeg(), age=2)
    assert folder.poll(3) == [('latest.jpg', 'state')]
    folder.put('latest.jpg', jpeg(), age=2)
    assert folder.poll(3) == [('latest.jpg', 'state')]
    assert folder.problems == []
    folder.put('copy.jpg', first, age=3)
    assert folder.poll(3) == []
    assert folder.problems == [('copy.jpg', 'duplicate')]


def test_a_restarted_camera_goes_on_after_the_last_photograph(tmp_path) -> None:
    (tmp_path / 'photos').mkdir()
    folder = WatchedFolder(tmp_path / 'photos', tmp_path / 'progress')
    first = jpeg()
    folder.put('0.jpg', first)
    folder.put('1.jpg', jpeg(), age=1)
    assert len(folder.poll(3)) == 2
    folder.put('2.jpg', jpeg(), age=2)
    folder.start()
    folder.after_reading = lambda path: read.append(path.name)
    read: list[str] = []
    assert folder.poll(3) == [('2.jpg', 'state')]
    assert read == ['2.jpg']
    assert folder.times['2.jpg'] == BEGIN + 2 * INTERVAL
    folder.forwarder.send_baselines_again()
    assert folder.times['baseline of an earlier start'] == BEGIN
    folder.put('0.jpg', first, age=3)  # touched while the camera was away
    folder.start()
    assert folder.poll(3) == []
    assert folder.problems == []


def test_an_old_photograph_that_turns_up_late_is_left_out(folder) -> None:
    folder.put('1.jpg', jpeg(), age=10)
    folder.put('2.jpg', jpeg(), age=11)
    assert len(folder.poll(2)) == 2
    folder.put('0.jpg', jpeg(), age=2)
    assert folder.poll(3) == []
    assert folder.problems == [('0.jpg', 'time')]


def test_a_folder_that_disappears_may_come_back(folder) -> None:
    folder.put('a.jpg', jpeg())
    shutil.move(folder.path, folder.path.with_name('away'))
    assert folder.poll(2) == []
    assert 'does not answer: No such file' in folder.forwarder.absent
    shutil.move(folder.path.with_name('away'), folder.path)
    assert folder.poll(2) == [('a.jpg', 'baseline')]


def test_a_missing_folder_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match='no such folder'):
        check_folder(str(tmp_path / 'nowhere'))
    check_folder(str(tmp_path))


def test_old_files_are_not_read_again(folder) -> None:
    for number in range(300):
        folder.put(f'{number:03d}.jpg', jpeg(), age=number)
    assert len(folder.poll(1 + 300 // MOST_AT_ONCE)) == 300
    folder.after_reading = lambda path: pytest.fail(f'read {path} again')
    assert folder.poll(3) == []


def test_many_files_come_a_few_at_a_time_in_the_order_of_exposure(folder) -> None:
    # copied in the reverse order: the times of the files say nothing
    names = [f'{number:03d}.jpg' for number in range(30)]
    for number, name in enumerate(names):
        folder.put(name, dated(f'2021:09:03 14:05:{number:02d}', '+00:00'), age=30 - number)
    folder.put('015.jpg', jpeg()[:500], age=15)
    read: list[str] = []
    folder.after_reading = lambda path: read.append(path.name)
    assert folder.poll() == []
    found = []
    for _ in range(8):
        read.clear()
        polled = [name for name, _ in folder.poll()]
        assert len(polled) <= MOST_AT_ONCE
        assert len(read) <= MOST_AT_ONCE + 1
        found += polled
    del names[15]
    assert found == names[: len(found)]
    assert found + [name for name, _ in folder.poll(20)] == names
    assert ('015.jpg', 'truncated') in folder.problems


def test_a_late_protocol_gives_the_times_of_the_waiting_files(folder) -> None:
    for number in range(10):
        folder.put(f'{number}.jpg', jpeg(), age=number)
    assert folder.poll(2) == [('0.jpg', 'baseline'), *((f'{n}.jpg', 'state') for n in (1, 2, 3))]
    lines = [f'{60 - number},{number}.jpg,state' for number in range(10)]
    (folder.path / 'imaging.csv').write_text('\n'.join(['time_s,path,role', *lines]))
    assert [name for name, _ in folder.poll(2)] == [f'{n}.jpg' for n in (9, 8, 7, 6, 5, 4)]
