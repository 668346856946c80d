"""A watched folder: whole files, once, in order."""

import io
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.errors import InputError
from porotwin_imaging.sources import MOST_AT_ONCE, Device, Folder

GENERATOR = np.random.default_rng(2)


def jpeg() -> bytes:
    pixels = GENERATOR.integers(0, 255, (40, 60, 3), dtype=np.uint8)
    return cv2.imencode('.jpg', pixels)[1].tobytes()


class Clock:
    """A clock that tests turn by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class Watch:
    """A folder with its clock; `look` is one poll, half a second later."""

    def __init__(self, path: Path) -> None:
        self.path, self.clock = path, Clock()
        self.folder = Folder(path, patience=5.0, clock=self.clock)
        self.problems: list[str] = []

    def look(self, times: int = 1) -> list[tuple[str, str]]:
        found = []
        for _ in range(times):
            self.clock.now += 0.5
            photos, problems = self.folder.poll()
            found += [(photo.name, photo.role) for photo in photos]
            self.problems += [problem.reason for problem in problems]
        return found

    def put(self, name: str, data: bytes, age: float = 0.0) -> None:
        (self.path / name).write_bytes(data)
        os.utime(self.path / name, (1000.0 + age, 1000.0 + age))


@pytest.fixture
def watch(tmp_path) -> Watch:
    return Watch(tmp_path)


def test_photographs_come_once_the_first_as_baseline(watch) -> None:
    watch.put('b.jpg', jpeg(), age=2)
    watch.put('a.jpg', jpeg(), age=1)
    watch.put('notes.txt', b'no photograph')
    assert watch.look(3) == [('a.jpg', 'baseline'), ('b.jpg', 'state')]
    watch.put('c.png', cv2.imencode('.png', np.zeros((9, 9, 3), np.uint8))[1].tobytes(), age=3)
    assert watch.look(3) == [('c.png', 'state')]
    os.utime(watch.path / 'a.jpg', (2000.0, 2000.0))
    assert watch.look(3) == []
    assert watch.problems == []


def test_a_photograph_that_shows_nothing_is_no_baseline(watch) -> None:
    for age, level in enumerate((0, 255, 90)):
        grey = np.full((64, 96, 3), level, np.uint8)
        watch.put(f'{age + 1}.jpg', cv2.imencode('.jpg', grey)[1].tobytes(), age)
    watch.put('4.jpg', jpeg(), age=4)
    assert watch.look(3) == [('3.jpg', 'baseline'), ('4.jpg', 'state')]
    assert "'1.jpg' cannot be the baseline, the next one is tried: " in watch.problems[0]
    assert 'over-exposed' in watch.problems[1]


def test_a_file_that_is_written_slowly_comes_when_it_is_whole(watch) -> None:
    data = jpeg()
    for end in range(100, len(data), 400):
        watch.put('slow.jpg', data[:end], age=end)
        assert watch.look() == []
    watch.put('slow.jpg', data, age=9999)
    assert watch.look(2) == [('slow.jpg', 'baseline')]


def test_a_newer_file_waits_for_an_older_one_but_not_for_ever(watch) -> None:
    data = jpeg()
    watch.put('1.jpg', data[:500], age=1)
    watch.put('2.jpg', jpeg(), age=2)
    assert watch.look(4) == []
    watch.put('1.jpg', data, age=1)
    assert watch.look(2) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    watch.put('3.jpg', data[:500], age=3)
    watch.put('4.jpg', jpeg(), age=4)
    assert watch.look(30) == [('4.jpg', 'state')]
    assert len(watch.problems) == 1
    assert "'3.jpg' is truncated or broken" in watch.problems[0]
    watch.put('3.jpg', data, age=5)
    assert watch.look(2) == [('3.jpg', 'state')]


def test_the_protocol_gives_roles_and_times_and_may_grow(tmp_path) -> None:
    photos = tmp_path / 'photos'
    photos.mkdir()
    watch = Watch(photos)
    protocol = tmp_path / 'imaging.csv'
    protocol.write_text('time_s,path,role\n0,photos/x.jpg,baseline\n30,photos/a.jpg,state\n')
    watch.put('a.jpg', jpeg())
    watch.put('x.jpg', jpeg(), age=1)
    assert watch.look(3) == [('x.jpg', 'baseline'), ('a.jpg', 'state')]
    protocol.write_text(protocol.read_text() + '60,photos/b.jpg,baseline\n')
    watch.put('b.jpg', jpeg())
    assert watch.look(3) == [('b.jpg', 'baseline')]


def test_a_protocol_with_a_wrong_line_is_named(watch) -> None:
    (watch.path / 'imaging.csv').write_text('time_s,path,role\nsoon,a.jpg,state\n')
    watch.look()
    assert 'write time_s,path,role' in watch.problems[0]


def test_a_protocol_that_is_no_utf8_or_has_no_number_is_named(watch) -> None:
    protocol = watch.path / 'imaging.csv'
    protocol.write_bytes('time_s,path,role\n0,größe.jpg,baseline\n'.encode('cp1252'))
    watch.put('a.jpg', jpeg())
    assert watch.look(3) == [('a.jpg', 'baseline')]
    protocol.write_text('time_s,path,role\nnan,a.jpg,state\n')
    watch.put('b.jpg', jpeg(), age=1)
    assert watch.look(3) == [('b.jpg', 'state')]
    assert len(watch.problems) == 2
    assert 'save it as CSV in UTF-8' in watch.problems[0]
    assert 'a finite number' in watch.problems[1]


def dated(original: str, offset: str) -> bytes:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: original, 0x9011: offset})
    file = io.BytesIO()
    Image.new('RGB', (30, 20), (90, 90, 90)).save(file, 'JPEG', exif=exif)
    return file.getvalue()


def test_a_photograph_with_a_wrong_clock_is_named_and_the_others_go_on(watch) -> None:
    watch.put('1.jpg', dated('2021:09:03 14:05:06', '+99:00'), age=1)
    watch.put('2.jpg', dated('0001:01:01 00:00:00', ''), age=2)
    watch.put('3.jpg', dated('2021:09:03 14:05:06', '+00:00'), age=3)
    assert watch.look(5) == [('3.jpg', 'baseline')]
    assert len(watch.problems) == 2
    assert "photograph '1.jpg' left out: EXIF time '2021:09:03 14:05:06+99:00'" in watch.problems[0]
    watch.put('1.jpg', dated('2021:09:03 14:05:36', '+00:00'), age=4)
    assert watch.look(3) == [('1.jpg', 'state')]


def test_a_photograph_removed_while_it_is_read_costs_nothing(watch, monkeypatch) -> None:
    watch.put('1.jpg', jpeg(), age=1)
    watch.put('2.jpg', jpeg(), age=2)
    read = Path.read_bytes

    def read_and_remove(path: Path) -> bytes:
        data = read(path)
        if path.name == '1.jpg':
            path.unlink()
        return data

    monkeypatch.setattr(Path, 'read_bytes', read_and_remove)
    assert watch.look(3) == [('1.jpg', 'baseline'), ('2.jpg', 'state')]
    assert watch.problems == []


def test_a_link_that_leads_nowhere_hides_no_other(watch) -> None:
    (watch.path / '0.jpg').symlink_to(watch.path / 'nowhere.jpg')
    watch.put('1.jpg', jpeg())
    (watch.path / '2.jpg').symlink_to(watch.path / 'nowhere.jpg')
    assert watch.look(2) == [('1.jpg', 'baseline')]


def test_a_folder_that_goes_away_is_waited_for(watch) -> None:
    watch.put('a.jpg', jpeg())
    shutil.move(watch.path, watch.path.with_name('away'))
    assert watch.look(2) == []
    shutil.move(watch.path.with_name('away'), watch.path)
    assert watch.look(2) == [('a.jpg', 'baseline')]


def test_a_folder_that_is_not_there_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match='no such folder'):
        Folder(tmp_path / 'nowhere')


def test_looking_at_many_old_files_reads_none_of_them(watch, monkeypatch) -> None:
    for number in range(300):
        watch.put(f'{number:03d}.jpg', jpeg(), age=number)
    assert len(watch.look(1 + 300 // MOST_AT_ONCE)) == 300
    monkeypatch.setattr(Path, 'read_bytes', lambda _: pytest.fail('read a file again'))
    assert watch.look(3) == []


def test_a_backlog_comes_a_few_at_a_time_in_the_order_of_exposure(watch, monkeypatch) -> None:
    # copied in the reverse order: the times of the files say nothing
    names = [f'{number:03d}.jpg' for number in range(30)]
    for number, name in enumerate(names):
        watch.put(name, dated(f'2021:09:03 14:05:{number:02d}', '+00:00'), age=30 - number)
    watch.put('015.jpg', jpeg()[:500], age=15)
    read: list[str] = []
    whole = Path.read_bytes
    monkeypatch.setattr(Path, 'read_bytes', lambda path: read.append(path.name) or whole(path))
    assert watch.look() == []
    found = []
    for _ in range(8):
        read.clear()
        looked = [name for name, _ in watch.look()]
        assert len(looked) <= MOST_AT_ONCE
        assert len(read) <= MOST_AT_ONCE + 1
        found += looked
    del names[15]
    assert found == names[: len(found)]
    assert found + [name for name, _ in watch.look(20)] == names
    assert any("'015.jpg' is truncated" in problem for problem in watch.problems)


def test_a_protocol_that_comes_late_gives_the_times_of_what_still_waits(watch) -> None:
    for number in range(10):
        watch.put(f'{number}.jpg', jpeg(), age=number)
    assert watch.look(2) == [('0.jpg', 'baseline'), *((f'{n}.jpg', 'state') for n in (1, 2, 3))]
    lines = [f'{60 - number},{number}.jpg,state' for number in range(10)]
    (watch.path / 'imaging.csv').write_text('\n'.join(['time_s,path,role', *lines]))
    assert [name for name, _ in watch.look(2)] == [f'{n}.jpg' for n in (9, 8, 7, 6, 5, 4)]


def test_a_camera_that_is_not_there_is_refused() -> None:
    with pytest.raises(InputError, match='cannot be opened'):
        Device('/dev/video99')


def test_a_camera_gives_photographs_stamped_at_exposure(monkeypatch) -> None:
    class Camera:
        taken = 0

        def __init__(self, _: object) -> None:
            self.alive = True

        def isOpened(self) -> bool:  # noqa: N802
            return True

        def set(self, *_: object) -> bool:
            return True

        def grab(self) -> bool:
            return True

        def release(self) -> None:
            self.alive = False

        def read(self) -> tuple[bool, np.ndarray | None]:
            Camera.taken += 1
            # unplugged for a moment, a camera answers only when it is opened again
            self.alive = self.alive and Camera.taken != 3
            return self.alive, np.full((30, 40, 3), 10 * Camera.taken, np.uint8)

    monkeypatch.setattr(cv2, 'VideoCapture', Camera)
    moments = iter([6.0, 7.0, 8.0, 9.0])
    camera = Device('0', clock=lambda: next(moments))
    dark, refused = camera.poll()
    assert dark == []
    assert 'cannot be the baseline, the next one is tried: photograph is black' in refused[0].reason
    first, _ = camera.poll()
    none, problems = camera.poll()
    last, _ = camera.poll()
    assert [(p.time, p.role) for p in (*first, *last)] == [(7.0, 'baseline'), (9.0, 'state')]
    assert none == []
    assert 'gave no picture' in problems[0].reason
