"""Forwarding continues whatever a poll or a photograph raises."""

from collections.abc import Callable

import pytest

from porotwin_core.basis.remark import Remark
from porotwin_imaging.camera.photo_forwarding import PhotoForwarder
from porotwin_imaging.photograph.sent_photos import SentPhotos
from porotwin_imaging.sources.camera_source import CameraPhoto, Polled

NOW = 1.8e9
"""Time of the first photograph [s since 1970]."""


class FakeSource:
    """A source whose poll is a function."""

    def __init__(self, poll: Callable[[], Polled]) -> None:
        self.poll = poll


class Receiver:
    """Keeps the names that were sent, their times, the problems and the remarks."""

    def __init__(self, poll: Callable[[], Polled], sent: SentPhotos | None = None) -> None:
        self.names: list[str] = []
        self.times: list[float] = []
        self.problems: list[tuple[str, str]] = []
        self.lines: list[str] = []
        self.forwarder = PhotoForwarder(
            FakeSource(poll),
            send=self._send,
            report=self._report,
            say=self.lines.append,
            sent=sent or SentPhotos(None),
            interval_s=30.0,
        )

    def _send(self, photo: CameraPhoto) -> None:
        if photo.name == '2.jpg':
            raise AssertionError('not a stamp')
        self.names.append(photo.name)
        self.times.append(photo.time)

    def _report(self, problem: Remark) -> None:
        str(problem).encode('utf-8')  # as a log does
        self.problems.append((problem.key, problem.code))


def photo(name: str, time: float) -> CameraPhoto:
    return CameraPhoto(name.encode('utf-8', 'surrogateescape'), NOW + time, name, 'state')


def test_a_photograph_that_cannot_be_sent_is_reported_and_the_others_are_sent() -> None:
    photos = [photo(f'{time:g}.jpg', time) for time in (1.0, 2.0, 3.0)]
    receiver = Receiver(
        lambda: Polled(photos, [Remark('0.jpg', '', 'cut', 'copy it', code='truncated')])
    )
    receiver.forwarder.forward()
    assert receiver.names == ['1.jpg', '3.jpg']
    assert receiver.problems == [('0.jpg', 'truncated'), ('2.jpg', 'unsent')]


def test_complaints_are_valid_text_whatever_the_name() -> None:
    name = '\udcff\n.jpg'
    polled = Polled([photo(name, 1.0)], [Remark(name, '', f'{name} is broken', '', code='broken')])
    receiver = Receiver(lambda: polled)
    receiver.forwarder.forward()
    assert receiver.problems == [(r'\xff\n.jpg', 'broken')]
    assert receiver.names == [name]


def test_a_poll_that_fails_is_reported_once_and_its_end_as_well() -> None:
    fails = True

    def poll() -> Polled:
        if fails:
            raise RuntimeError('unexpected')
        return Polled([], [])

    receiver = Receiver(poll)
    for _ in range(3):
        receiver.forwarder.forward()
    assert receiver.problems == [('camera', 'absent')]
    assert receiver.forwarder.absent
    fails = False
    receiver.forwarder.forward()
    assert not receiver.forwarder.absent
    assert receiver.lines == ['the camera answers again']


def test_the_same_picture_again_is_left_out() -> None:
    polls = iter(
        [Polled([CameraPhoto(b'frozen', NOW + 30.0 * n, f'{n}', 'state')], []) for n in range(3)]
    )
    receiver = Receiver(lambda: next(polls))
    for _ in range(3):
        receiver.forwarder.forward()
    assert receiver.names == ['0']
    assert receiver.problems[0] == ('1', 'duplicate')


def test_stamps_increase_across_a_restart(tmp_path) -> None:
    first = Receiver(lambda: Polled([photo('1.jpg', 10.0)], []), SentPhotos(tmp_path))
    first.forwarder.forward()
    first.forwarder.keep()
    # the new source stamps with a clock that has hardly moved
    again = Receiver(lambda: Polled([photo('3.jpg', 9.5)], []), SentPhotos(tmp_path))
    again.forwarder.forward()
    assert again.times == [pytest.approx(NOW + 10.002, abs=1e-6)]
