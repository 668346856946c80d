"""A camera that repeats its last picture: fresh noise is the sign of a new photograph.

A frozen camera may write new times and compress the old picture again, so that its files differ.
The noise of a sensor never repeats. So the difference of two photographs, without the movement of
the camera between them, never falls far below the difference of earlier ones.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.photograph.photo_file import DecodedPhoto

Array = NDArray[Any]

_REDUCTION = 4
"""Coarseness at which photographs are compared: finer noise is lost in a JPEG."""
_SIDE = 256
"""Most rows and columns that are compared, at that coarseness: this takes some milliseconds."""
_BLOCK = 8
"""Side of the blocks whose differences are measured [px]; the movement is one for all of them."""
_REPEATED = 0.65
"""Share of the least difference so far below which a picture is an old one. Measured on rendered
photographs: fresh noise 0.9 to 1.2, compressed again 0.1 to 0.63 at a quality of 90 or more."""
_BUFFERS = 3
"""Pictures that a camera holds at once; a frozen one may send them in turn."""
_STILL = 0.02
"""Movement below which noise alone makes the difference of two photographs [px]."""


@dataclass
class FrozenCamera:
    """Compares each photograph with the last ones.

    Attributes:
        last: middles of the last photographs, float32, the newest last.
        least: least difference of two photographs of a still camera so far [grey levels].
    """

    last: deque[Array] = field(default_factory=lambda: deque(maxlen=_BUFFERS))
    least: float = math.inf

    def check(self, photo: DecodedPhoto) -> None:
        """Take note of a photograph.

        Raises:
            InputError: it shows the picture of one of the last ones again.
        """
        middle = _middle(photo)
        least = self.least
        for before in (one for one in self.last if one.shape == middle.shape):
            noise, largest, moved = _difference(before, middle)
            still = moved < _STILL
            if largest == 0.0 or (still and noise < _REPEATED * self.least < math.inf):
                raise InputError(
                    'the camera is frozen: it shows one of its last pictures again, without fresh '
                    'noise; restart the camera. No rates follow meanwhile'
                )
            if still and noise > 0.0:
                least = min(least, noise)
        self.least = least
        self.last.append(middle)


def _middle(photo: DecodedPhoto) -> Array:
    """Return the green of the middle of a photograph, float32."""
    step = max(1, _REDUCTION // photo.reduction)
    parts = []
    for length in photo.pixels.shape[:2]:
        size = min(_SIDE, length // step) * step
        parts.append(slice((length - size) // 2, (length + size) // 2))
    green = np.ascontiguousarray(photo.pixels[parts[0], parts[1], 1], np.float32)
    size = (green.shape[1] // step, green.shape[0] // step)
    return np.asarray(cv2.resize(green, size, interpolation=cv2.INTER_AREA))


def _difference(before: Array, after: Array) -> tuple[float, float, float]:
    """Return how the middle `after` differs from the one `before`.

    Returns:
        typical noise of a block [grey levels], beside movement and light; the largest difference of
        a pixel, in nine blocks of ten; the movement of the camera [px].
    """
    up, right = np.gradient(before)
    parts = np.stack([_blocks(part) for part in (after - before, right, up, before)])
    parts -= parts.mean(axis=-1, keepdims=True)
    change, shapes = parts[0], parts[1:]
    quiet = np.ones(len(change), dtype=bool)
    for _ in range(2):  # the second time without the blocks in which the tracer moves
        known = shapes[:, quiet].reshape(len(shapes), -1)
        weights = np.linalg.lstsq(known @ known.T, known @ change[quiet].ravel(), rcond=None)[0]
        left = np.sqrt(np.mean((change - np.tensordot(weights, shapes, axes=1)) ** 2, axis=1))
        quiet = left <= np.median(left)
    largest = np.quantile(np.abs(change).max(axis=1), 0.9)
    return float(np.quantile(left, 0.25)), float(largest), math.hypot(*weights[:2])


def _blocks(picture: Array) -> Array:
    """Return the whole blocks of a picture, (n, pixels of a block)."""
    rows, columns = (size // _BLOCK for size in picture.shape)
    whole = picture[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
    return whole.swapaxes(1, 2).reshape(rows * columns, -1)
