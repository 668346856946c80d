"""Linear light from the grey levels of a photograph (sRGB, IEC 61966-2-1)."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

_LEVELS = np.linspace(0.0, 1.0, 256)
LINEAR_LIGHT = np.where(
    _LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4
).astype(np.float32)
"""Linear light of the 256 grey levels, shape (256,), from 0 to 1."""


def linear_light(pixels: NDArray[np.uint8]) -> Array:
    """Return linear red-green-blue of 8-bit blue-green-red `pixels`, shape (rows, columns, 3)."""
    return cv2.LUT(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), LINEAR_LIGHT)


def linear_light_near(pixels: NDArray[np.uint8], corners: Array) -> Array:
    """Return linear light of the same shape as `pixels`, computed only near `corners`.

    Pixels farther from `corners` (n, 2) than twice their extent are 0. That saves the time of
    converting the whole picture.
    """
    reach = 2 * int(np.ptp(corners, axis=0).max())
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - reach, 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + reach
    picture = np.zeros(pixels.shape, np.float32)
    area = (slice(low[1], high[1]), slice(low[0], high[0]))
    picture[area] = linear_light(np.ascontiguousarray(pixels[area]))
    return picture
