"""A USB or Video4Linux camera, read by OpenCV: one photograph per poll, encoded as JPEG.

Such cameras adapt exposure, white balance and focus to the scene, which looks like tracer. The
source lets them settle once and then fixes them. A camera that was unplugged is opened again with
the same values.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.clock.stamps import steady_time
from porotwin_imaging.photograph.file_names import printable
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    Polled,
    SourceKind,
    SourceOption,
)

JPEG_QUALITY = 95
"""JPEG quality (0 to 100), nearly lossless."""
SETTLING_FRAMES = 30
"""Frames until automatic exposure and white balance have settled: about a second."""
WAITING_FRAMES = 4
"""Frames that may wait in the driver since the last photograph; they are old."""
_FIXED = (
    ('exposure', cv2.CAP_PROP_AUTO_EXPOSURE, 1, cv2.CAP_PROP_EXPOSURE),
    ('white balance', cv2.CAP_PROP_AUTO_WB, 0, cv2.CAP_PROP_WB_TEMPERATURE),
    ('focus', cv2.CAP_PROP_AUTOFOCUS, 0, cv2.CAP_PROP_FOCUS),
)
"""Name, the switch of the automatic with its value for manual in Video4Linux, and the value."""


class DeviceSource:
    """Takes a photograph at each poll. A camera that gives none is opened again.

    Args:
        device: a number, a path such as /dev/video0, or the URL of a stream.
        width: requested columns [px]; 0 for the default of the camera.
        height: requested rows [px]; 0 for the default of the camera.
        exposure: exposure in the camera's unit, 0.1 ms for most; 0: as the camera chose at first.
        white_balance_k: colour temperature [K]; 0: as the camera chose at first.
        fixed: fix exposure, white balance and focus.
        clock: returns the exposure time [s].
        open_camera: opens a camera as `cv2.VideoCapture` does.

    Raises:
        InputError: one of width and height is given alone.
    """

    def __init__(
        self,
        device: int | str,
        *,
        width: int = 0,
        height: int = 0,
        exposure: float = 0.0,
        white_balance_k: float = 0.0,
        fixed: bool = True,
        clock: Callable[[], float] = steady_time,
        open_camera: Callable[[Any], Any] = cv2.VideoCapture,
    ) -> None:
        if (width == 0) != (height == 0):  # OpenCV takes both together only
            given, missing = ('width', 'height') if width else ('height', 'width')
            raise InputError(
                f'{given} of the photographs without {missing}; give both, or leave both out'
            )
        self._address = str(device)
        self._name = printable(self._address.rpartition('@')[2])  # without a password
        self._size = (width, height)
        self._fixed = fixed
        self._values: dict[str, float] = {}
        if exposure:
            self._values['exposure'] = exposure
        if white_balance_k:
            self._values['white balance'] = white_balance_k
        self._clock = clock
        self._open_camera = open_camera
        self._camera: Any = None
        self._began = f'{clock():.0f}'
        self._taken = 0

    def poll(self) -> Polled:
        """Take a photograph; see `CameraSource.poll`."""
        remarks: tuple[str, ...] = ()
        if self._camera is None:
            self._camera = self._opened()
            if self._camera is None:
                return self._absent('cannot be opened; see which /dev/video* exist')
            remarks = self._settled(self._camera)
        for _ in range(WAITING_FRAMES):
            self._camera.grab()
        moment = self._clock()
        taken, pixels = self._camera.read()
        if not taken:
            # a camera that was unplugged answers only after it is opened again
            self._camera.release()
            self._camera = None
            return self._absent('gave no picture; check its cable')
        encoded, data = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not encoded:
            words = 'the camera gave a picture that cannot be encoded; check it'
            problem = Remark.of(self._name, 'unencodable', words)
            return Polled([], [problem], remarks=remarks)
        self._taken += 1
        name = f'{self._name}-{self._began}-{self._taken:06d}.jpg'
        return Polled([CameraPhoto(data.tobytes(), moment, name)], [], remarks=remarks)

    def _opened(self) -> Any | None:
        """Return the opened camera with the requested size, None if it cannot be opened."""
        number = self._address.isdecimal()
        camera = self._open_camera(int(self._address) if number else self._address)
        if not camera.isOpened():
            camera.release()
            return None
        camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        width, height = self._size
        if width and height:
            camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        return camera

    def _settled(self, camera: Any) -> tuple[str, ...]:
        """Fix the settings of an opened camera; return lines that say which."""
        if not self._fixed:
            return (f"camera '{self._name}' may adapt its exposure and white balance",)
        for _ in range(SETTLING_FRAMES):
            camera.grab()
        done, failed = [], []
        for name, switch, manual, value in _FIXED:
            wanted = self._values.setdefault(name, float(camera.get(value)))
            if camera.set(switch, manual) and camera.set(value, wanted):
                done.append(f'{name} {wanted:g}')
            else:
                failed.append(name)
        lines = [f"camera '{self._name}' fixed: {', '.join(done) or 'nothing'}"]
        if failed:
            lines.append(
                f"camera '{self._name}' does not let OpenCV fix {' and '.join(failed)}; "
                'use v4l2-ctl if it adapts them'
            )
        return tuple(lines)

    def _absent(self, text: str) -> Polled:
        return Polled([], [], absent=f"camera '{self._name}' {text}")


def check_device(address: str) -> None:
    """Check the address of a camera.

    Raises:
        InputError: there is no such device, or this user may not use it.
    """
    if '://' in address:
        return
    path = Path(f'/dev/video{address}' if address.isdecimal() else address)
    named = printable(address)
    if not path.exists():
        found = ', '.join(sorted(str(one) for one in Path('/dev').glob('video*'))) or 'none'
        raise InputError(f"camera '{named}' does not exist; cameras of this computer: {found}")
    if not path.is_char_device():
        raise InputError(f"camera '{named}' is no device; for a folder write folder:{named}")
    if not os.access(path, os.R_OK | os.W_OK):
        raise InputError(f"camera '{named}' may not be used; add this user to the group video")


SOURCE = SourceKind(
    name='device',
    address='number of a camera, or a path such as /dev/video0',
    open=DeviceSource,
    check=check_device,
    options=(
        SourceOption('width', 0, 'requested columns of the photographs [px]; 0: default', 0, 30000),
        SourceOption('height', 0, 'requested rows of the photographs [px]; 0: default', 0, 30000),
        SourceOption(
            'exposure', 0.0, 'exposure in the unit of the camera; 0: as it chose at first', -20, 1e6
        ),
        SourceOption(
            'white_balance_k', 0.0, 'colour temperature [K]; 0: as it chose at first', 0, 20000
        ),
        SourceOption('fixed', True, 'fix exposure, white balance and focus'),
    ),
)
