"""A camera on USB, with a fake in place of OpenCV's."""

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_imaging.sources.device import DeviceSource


class FakeCamera:
    """Stands for cv2.VideoCapture: is unplugged at the photograph `fails_at` until reopened."""

    def __init__(self, *, fails_at: int) -> None:
        self.opened = 0
        self._fails_at = fails_at
        self._taken = 0
        self._connected = False

    def open(self, _: object) -> 'FakeCamera':
        self.opened += 1
        self._connected = True
        return self

    def isOpened(self) -> bool:  # noqa: N802
        return self._connected

    def set(self, *_: object) -> bool:
        return True

    def grab(self) -> bool:
        return True

    def release(self) -> None:
        self._connected = False

    def read(self) -> tuple[bool, np.ndarray]:
        self._taken += 1
        self._connected = self._connected and self._taken != self._fails_at
        return self._connected, np.full((30, 40, 3), 10 * self._taken, np.uint8)


def test_a_missing_camera_is_refused() -> None:
    with pytest.raises(InputError, match='cannot be opened'):
        DeviceSource('/dev/video99')


def test_photographs_are_stamped_at_exposure_and_an_unplugged_camera_is_opened_again() -> None:
    fake = FakeCamera(fails_at=2)
    moments = iter([6.0, 7.0, 8.0])
    source = DeviceSource('0', clock=lambda: next(moments), open_camera=fake.open)
    first, failed, last = (source.poll() for _ in range(3))
    assert [(photo.time, photo.role) for photo in (*first.photos, *last.photos)] == [
        (6.0, None),
        (8.0, None),
    ]
    assert failed.photos == []
    assert 'gave no picture' in failed.problems[0].reason
    assert fake.opened == 2
