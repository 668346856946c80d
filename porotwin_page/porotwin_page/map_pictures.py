"""Maps as PNG pictures: one pixel for every cell, top row first, unseen cells transparent.

The colour maps are perceptually uniform, with one set for light rooms and one for dark rooms:
`magma` for concentrations, a diverging map for differences.
"""

import functools
from typing import Literal

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray

Theme = Literal['light', 'dark']
Quantity = Literal['concentration', 'difference']
Colours = NDArray[np.uint8]

_COLOUR_MAPS = {
    ('concentration', 'light'): ('magma', 0.98, 0.10),
    ('concentration', 'dark'): ('magma', 0.04, 1.0),
    ('difference', 'light'): ('RdBu', 1.0, 0.0),
    ('difference', 'dark'): ('berlin', 0.0, 1.0),
}
"""Name of the colour map, and its part in use: position of the smallest and largest value."""

_LEVELS = 256

DIFFERENCE_LIMITS = (0.05, 0.1, 0.2, 0.5, 1.0)
"""Possible limits of a difference scale [-]; few, so that colours rarely change their meaning."""

_SHOWN_FRACTION = 0.998
"""Part of the differences within the limit; a few bright grains of sand lie outside."""


@functools.cache
def colour_table(quantity: Quantity, theme: Theme) -> Colours:
    """Return the colours (256, 4) from the smallest to the largest value, blue-green-red-alpha."""
    name, smallest, largest = _COLOUR_MAPS[quantity, theme]
    table = mpl.colormaps[name](np.linspace(smallest, largest, _LEVELS), bytes=True)
    return np.ascontiguousarray(table[:, [2, 1, 0, 3]])


def paint(values: FloatArray, low: float, high: float, table: Colours) -> Colours:
    """Return `values` (nz, nx), row 0 at the bottom, as pixels (nz, nx, 4), row 0 at the top.

    Values outside [low, high] have the colour of the nearest limit. NaN is transparent.
    """
    seen = np.isfinite(values)
    level = (np.where(seen, values, low) - low) / (high - low)
    pixels = table[np.rint((_LEVELS - 1) * np.clip(level, 0.0, 1.0)).astype(np.uint8)]
    pixels[~seen] = 0
    return np.flipud(pixels)


def on_grey(pixels: Colours) -> Colours:
    """Return pixels (rows, columns, 4) without transparency (rows, columns, 3): grey there."""
    return np.where(pixels[..., 3:] == 0, np.uint8(128), pixels[..., :3])


def png(pixels: Colours) -> bytes:
    """Return pixels (rows, columns, 4), blue-green-red-alpha, as a PNG file.

    Raises:
        RuntimeError: the encoder failed.
    """
    encoded, data = cv2.imencode('.png', pixels)
    if not encoded:
        raise RuntimeError(f'pixels of shape {pixels.shape} cannot be encoded as PNG')
    return data.tobytes()


def difference_limit(difference: FloatArray) -> float:
    """Return the limit [-] of a symmetric scale that covers 99.8 % of `difference` (nz, nx)."""
    size = np.abs(difference[np.isfinite(difference)])
    largest = float(np.quantile(size, _SHOWN_FRACTION)) if size.size else 0.0
    return next((limit for limit in DIFFERENCE_LIMITS if limit >= largest), DIFFERENCE_LIMITS[-1])


def scale(quantity: Quantity, theme: Theme) -> bytes:
    """Return the colours from the smallest to the largest value, as a PNG of 256 x 1 pixels."""
    return png(colour_table(quantity, theme)[None])
