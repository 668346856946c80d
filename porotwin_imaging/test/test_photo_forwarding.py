"""Forwarding continues whatever a poll or a photograph raises."""

from collections.abc import Callable

from porotwin_imaging.photo_forwarding import PhotoForwarder
from porotwin_imaging.sources.camera_source import CameraPhoto, PhotoProblem, Polled


class FakeSource:
    """A source whose poll is a function."""

    def __init__(self, poll: Callable[[], Polled]) -> None:
        self.poll = poll


def test_a_photograph_that_cannot_be_sent_is_reported_and_the_others_are_sent() -> None:
    photos = [CameraPhoto(b'', time, f'{time:g}.jpg', 'state') for time in (1.0, 2.0, 3.0)]
    sent: list[str] = []
    problems: list[PhotoProblem] = []

    def send(photo: CameraPhoto) -> None:
        if photo.time == 2.0:
            raise AssertionError('not a stamp')
        sent.append(photo.name)

    source = FakeSource(lambda: Polled(photos, [PhotoProblem('0.jpg', 'truncated')]))
    PhotoForwarder(source, send=send, report=problems.append).forward()
    assert sent == ['1.jpg', '3.jpg']
    assert problems[0].reason == 'truncated'
    assert problems[1].reason.startswith("photograph '2.jpg' cannot be sent: AssertionError")


def test_a_poll_that_fails_is_reported() -> None:
    def poll() -> Polled:
        raise RuntimeError('unexpected')

    problems: list[PhotoProblem] = []
    PhotoForwarder(FakeSource(poll), send=lambda _: None, report=problems.append).forward()
    (problem,) = problems
    assert problem.reason == "looking for photographs failed: RuntimeError('unexpected')"
