"""A USB or Video4Linux camera, read by OpenCV: one photograph per poll, encoded as JPEG."""

import time
from collections.abc import Callable
from typing import Any

import cv2

from porotwin_core.errors import InputError
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    PhotoProblem,
    Polled,
    SourceKind,
    SourceOption,
)

JPEG_QUALITY = 95
"""JPEG quality (0 to 100), nearly lossless."""


class DeviceSource:
    """Takes a photograph at each poll. A camera that gives none is opened again.

    Args:
        device: a number, or a path such as /dev/video0.
        width: requested columns [px]; 0 for the default of the camera.
        height: requested rows [px]; 0 for the default of the camera.
        clock: returns the exposure time [s].
        open_camera: opens a camera as `cv2.VideoCapture` does.

    Raises:
        InputError: the camera cannot be opened.
    """

    def __init__(
        self,
        device: int | str,
        *,
        width: int = 0,
        height: int = 0,
        clock: Callable[[], float] = time.time,
        open_camera: Callable[[Any], Any] = cv2.VideoCapture,
    ) -> None:
        self._name = str(device)
        self._size = (width, height)
        self._clock = clock
        self._open_camera = open_camera
        self._taken = 0
        self._camera = self._opened()
        if not self._camera.isOpened():
            raise InputError(f"camera '{device}' cannot be opened; see which /dev/video* exist")

    def _opened(self) -> Any:
        """Return the opened camera with the requested size."""
        name, (width, height) = self._name, self._size
        camera = self._open_camera(int(name) if name.isdigit() else name)
        camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if width and height:
            camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        return camera

    def poll(self) -> Polled:
        """Take a photograph; see `CameraSource.poll`."""
        self._camera.grab()  # drops a frame that was waiting in the driver
        moment = self._clock()
        taken, pixels = self._camera.read()
        if not taken:
            # a camera that was unplugged answers only after it is opened again
            self._camera.release()
            self._camera = self._opened()
            return self._problem('gave no picture; check it')
        encoded, data = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not encoded:
            return self._problem('gave a picture that cannot be encoded; check it')
        self._taken += 1
        name = f'{self._name}-{self._taken:06d}.jpg'
        return Polled([CameraPhoto(data.tobytes(), moment, name)], [])

    def _problem(self, text: str) -> Polled:
        return Polled([], [PhotoProblem(self._name, f"camera '{self._name}' {text}")])


SOURCE = SourceKind(
    name='device',
    address='number of a camera, or a path such as /dev/video0',
    open=DeviceSource,
    options=(
        SourceOption('width', 0, 'requested columns of the photographs [px]; 0: default'),
        SourceOption('height', 0, 'requested rows of the photographs [px]; 0: default'),
    ),
)
