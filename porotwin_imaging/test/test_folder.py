"""A watched folder gives complete files, once and in order."""

import io
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.errors import InputError
from porotwin_imaging.sources.baseline_choice import BaselineChoice
from porotwin_imaging.sources.folder import MOST_AT_ONCE, FolderSource

GENERATOR = np.random.default_rng(2)


def jpeg() -> bytes:
    pixels = GENERATOR.integers(0, 255, (40, 60, 3), dtype=np.uint8)
    return cv2.imencode('.jpg', pixels)[1].tobytes()


class WatchedFolder:
    """A folder with a clock that advances half a second per poll.

    Attributes:
        path: the folder.
        problems: reasons of all problems so far.
        after_reading: called with each file that the source has read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[str] = []
        self.after_reading: Callable[[Path], None] = lambda _: None
        self._now = 0.0
        self._roles = BaselineChoice()
        self._source = FolderSource(
            path, patience=5.0, clock=lambda: self._now, read_bytes=self._read
        )

    def _read(self, path: Path) -> bytes:
        data = path.read_bytes()
        self.after_reading(path)
        return data

    def poll(self, times: int = 1) -> list[tuple[str, str | None]]:
        """Return names and roles of the new photographs."""
        found = []
        for _ in range(times):
            self._now += 0.5
            photos, problems = self._roles.with_roles(self._source.poll())
            found += [(photo.name, photo.role) for photo in photos]
            self.problems += [problem.reason for problem in problems]
        return found

    def put(self, name: str, data: bytes, age: float = 0.0) -> None:
        (self.path / name).write_bytes(data)
        os.utime(self.path / name, (1000.0 + age, 1000.0 + age))


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
    os.utime(folder.path / 'a.jpg', (2000.0, 2000.0))
    assert folder.poll(3) == []
    assert folder.problems == []


def test_a_black_or_over_exposed_photograph_is_no_baseline(folder) -> None:
    for age, level in enumerate((0, 255, 90)):
        grey = np.full((64, 96, 3), level, np.uint8)
        folder.put(f'{age + 1}.jpg', cv2.imencode('.jpg', grey)[1].tobytes(), age)
    folder.put('4.jpg', jpeg(), age=4)
    assert folder.poll(3) == [('3.jpg', 'baseline'), ('4.jpg', 'state')]
    assert "'1.jpg' cannot be the baseline, the next one is tried: " in folder.problems[0]
    assert 'over-exposed' in folder.problems[1]


def test_a_file_that_is_written_slowly_comes_when_it_is_complete(folder) -> None:
    data = jpeg()
    for end in range(100, len(data), 400):
        folder.put('slow.jpg', data[:end], age=end)
        assert folder.poll() == []
    folder.put('slow.jpg', data, age=9999)
    assert folder.poll(2) == [('slow.jpg', 'baseline')]


def test_a_newer_file_waits_for_an_older_one_for_a_limited_time(folder) -> None:
    data = jpeg()
    folder.put('1.jpg', data[:500], age=1)
    folder.put('2.jpg', jpeg(), age=2)
    assert folder.poll(4) == []
    folder.put('1.jpg', data, age=1)
    assert folder.poll(2) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    folder.put('3.jpg', data[:500], age=3)
    folder.put('4.jpg', jpeg(), age=4)
    assert folder.poll(30) == [('4.jpg', 'state')]
    assert len(folder.problems) == 1
    assert "'3.jpg' is truncated or broken" in folder.problems[0]
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
    folder.put('b.jpg', jpeg())
    assert folder.poll(3) == [('b.jpg', 'baseline')]


def test_a_faulty_protocol_is_reported_and_photographs_still_come(folder) -> None:
    protocol = folder.path / 'imaging.csv'
    protocol.write_bytes('time_s,path,role\n0,größe.jpg,baseline\n'.encode('cp1252'))
    folder.put('a.jpg', jpeg())
    assert folder.poll(3) == [('a.jpg', 'baseline')]
    protocol.write_text('time_s,path,role\nnan,a.jpg,state\n')
    folder.put('b.jpg', jpeg(), age=1)
    assert folder.poll(3) == [('b.jpg', 'state')]
    assert len(folder.problems) == 2
    assert 'save it as CSV in UTF-8' in folder.problems[0]
    assert 'a finite number' in folder.problems[1]


def dated(original: str, offset: str) -> bytes:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: original, 0x9011: offset})
    file = io.BytesIO()
    Image.new('RGB', (30, 20), (90, 90, 90)).save(file, 'JPEG', exif=exif)
    return file.getvalue()


def test_a_photograph_with_an_impossible_time_is_reported_and_the_others_come(folder) -> None:
    folder.put('1.jpg', dated('2021:09:03 14:05:06', '+99:00'), age=1)
    folder.put('2.jpg', dated('0001:01:01 00:00:00', ''), age=2)
    folder.put('3.jpg', dated('2021:09:03 14:05:06', '+00:00'), age=3)
    assert folder.poll(5) == [('3.jpg', 'baseline')]
    assert len(folder.problems) == 2
    assert (
        "photograph '1.jpg' left out: EXIF time '2021:09:03 14:05:06+99:00'" in folder.problems[0]
    )
    folder.put('1.jpg', dated('2021:09:03 14:05:36', '+00:00'), age=4)
    assert folder.poll(3) == [('1.jpg', 'state')]


def test_a_photograph_that_is_removed_after_reading_is_sent(folder) -> None:
    folder.put('1.jpg', jpeg(), age=1)
    folder.put('2.jpg', jpeg(), age=2)

    def remove(path: Path) -> None:
        if path.name == '1.jpg':
            path.unlink()

    folder.after_reading = remove
    assert folder.poll(3) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    assert folder.problems == []


def test_a_broken_link_is_ignored(folder) -> None:
    (folder.path / '0.jpg').symlink_to(folder.path / 'nowhere.jpg')
    folder.put('1.jpg', jpeg())
    (folder.path / '2.jpg').symlink_to(folder.path / 'nowhere.jpg')
    assert folder.poll(2) == [('1.jpg', 'baseline')]


def test_a_folder_that_disappears_may_come_back(folder) -> None:
    folder.put('a.jpg', jpeg())
    shutil.move(folder.path, folder.path.with_name('away'))
    assert folder.poll(2) == []
    shutil.move(folder.path.with_name('away'), folder.path)
    assert folder.poll(2) == [('a.jpg', 'baseline')]


def test_a_missing_folder_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match='no such folder'):
        FolderSource(tmp_path / 'nowhere')


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
    assert any("'015.jpg' is truncated" in problem for problem in folder.problems)


def test_a_late_protocol_gives_the_times_of_the_waiting_files(folder) -> None:
    for number in range(10):
        folder.put(f'{number}.jpg', jpeg(), age=number)
    assert folder.poll(2) == [('0.jpg', 'baseline'), *((f'{n}.jpg', 'state') for n in (1, 2, 3))]
    lines = [f'{60 - number},{number}.jpg,state' for number in range(10)]
    (folder.path / 'imaging.csv').write_text('\n'.join(['time_s,path,role', *lines]))
    assert [name for name, _ in folder.poll(2)] == [f'{n}.jpg' for n in (9, 8, 7, 6, 5, 4)]
