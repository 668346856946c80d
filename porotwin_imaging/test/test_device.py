"""A camera on USB, with a fake in place of OpenCV's."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources.device import DeviceSource, check_device


class FakeCamera:
    """Stands for cv2.VideoCapture: is unplugged at the photograph `fails_at`, for two openings."""

    def __init__(self, *, fails_at: int = 0, fixes: bool = True) -> None:
        self.opened = 0
        self.values = {cv2.CAP_PROP_EXPOSURE: 156.0, cv2.CAP_PROP_WB_TEMPERATURE: 4600.0}
        self._fails_at = fails_at
        self._fixes = fixes
        self._taken = 0
        self._connected = False

    def open(self, _: object) -> 'FakeCamera':
        self.opened += 1
        self._connected = self.opened != 2
        # the camera adapts again after it was plugged in
        self.values[cv2.CAP_PROP_EXPOSURE] = 100.0 + 56.0 * self.opened
        return self

    def isOpened(self) -> bool:  # noqa: N802
        return self._connected

    def get(self, name: int) -> float:
        return self.values.get(name, 0.0)

    def set(self, name: int, value: float) -> bool:
        self.values[name] = value
        return self._fixes

    def grab(self) -> bool:
        return True

    def release(self) -> None:
        self._connected = False

    def read(self) -> tuple[bool, np.ndarray]:
        self._taken += 1
        self._connected = self._connected and self._taken != self._fails_at
        return self._connected, np.full((30, 40, 3), 10 * self._taken, np.uint8)


def test_a_missing_camera_is_refused_before_the_start_and_absent_afterwards(tmp_path) -> None:
    with pytest.raises(InputError, match=r"'/dev/video99' does not exist; cameras of"):
        check_device('/dev/video99')
    with pytest.raises(InputError, match=r"'99' does not exist"):
        check_device('99')
    with pytest.raises(InputError, match=r'is no device; for a folder write folder:'):
        check_device(str(tmp_path))
    check_device('rtsp://camera/stream')
    assert 'cannot be opened' in DeviceSource('/dev/video99').poll().absent


def test_photographs_are_stamped_at_exposure_and_an_unplugged_camera_is_opened_again() -> None:
    fake = FakeCamera(fails_at=2)
    moments = iter([5.0, 6.0, 7.0, 8.0])
    source = DeviceSource('0', clock=lambda: next(moments), open_camera=fake.open)
    first, failed, away, last = (source.poll() for _ in range(4))
    assert [(photo.time, photo.role) for photo in (*first.photos, *last.photos)] == [
        (6.0, None),
        (8.0, None),
    ]
    assert failed.photos == away.photos == []
    assert 'gave no picture' in failed.absent
    assert 'cannot be opened' in away.absent
    assert fake.opened == 3
    assert first.photos[0].name != last.photos[0].name


def test_exposure_and_white_balance_are_fixed_and_kept_after_an_interruption() -> None:
    fake = FakeCamera(fails_at=2)
    source = DeviceSource('0', white_balance_k=5000.0, open_camera=fake.open)
    (line,) = source.poll().remarks
    assert line == "camera '0' fixed: exposure 156, white balance 5000, focus 0"
    assert fake.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1
    assert fake.values[cv2.CAP_PROP_AUTO_WB] == 0
    for _ in range(3):
        source.poll()
    assert fake.opened == 3
    assert fake.values[cv2.CAP_PROP_EXPOSURE] == 156.0


def test_a_camera_that_cannot_be_fixed_says_so() -> None:
    fake = FakeCamera(fixes=False)
    lines = DeviceSource('0', open_camera=fake.open).poll().remarks
    assert 'does not let OpenCV fix exposure and white balance and focus' in lines[1]


def test_a_password_is_not_part_of_any_line() -> None:
    source = DeviceSource('rtsp://me:secret@cam/x', open_camera=lambda _: FakeCamera())
    polled = source.poll()
    assert 'cam/x' in polled.absent
    assert 'secret' not in polled.absent


def test_a_device_that_may_not_be_used_is_refused(monkeypatch) -> None:
    monkeypatch.setattr('os.access', lambda *_: False)
    assert Path('/dev/null').is_char_device()
    with pytest.raises(InputError, match='add this user to the group video'):
        check_device('/dev/null')


@pytest.mark.parametrize(('given', 'missing'), [('width', 'height'), ('height', 'width')])
def test_a_size_of_one_number_is_refused(given: str, missing: str) -> None:
    with pytest.raises(InputError, match=f'{given} of the photographs without {missing}'):
        DeviceSource('0', **{given: 1080})
