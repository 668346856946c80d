"""Maps as PNG pictures: one pixel a cell, top row first, unseen cells transparent.

The colour maps are perceptually uniform, one pair for light rooms and one for dark: `magma` from
the colour of sand to black or from black to bright, and a diverging one around zero.
"""

import functools
from typing import Literal

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray
from porotwin_page.snapshot import Map, Snapshot

Theme = Literal['light', 'dark']
Kind = Literal['observed', 'forecast', 'difference']
Colours = NDArray[np.uint8]

_COLOUR_MAPS = {
    ('concentration', 'light'): ('magma', 0.98, 0.10),
    ('concentration', 'dark'): ('magma', 0.04, 1.0),
    ('difference', 'light'): ('RdBu', 1.0, 0.0),
    ('difference', 'dark'): ('berlin', 0.0, 1.0),
}
"""Name of each map, and the part of it that is used, from the least value to the most."""

DIFFERENCE_LIMITS = (0.05, 0.1, 0.2, 0.5, 1.0)
"""Ends of the difference's scale: few, so that the colours do not change with every photograph."""


@functools.cache
def colour_table(quantity: Literal['concentration', 'difference'], theme: Theme) -> Colours:
    """Return the 256 colours (256, 4), blue-green-red-alpha, from the least value to the most."""
    name, least, most = _COLOUR_MAPS[quantity, theme]
    table = mpl.colormaps[name](np.linspace(least, most, 256), bytes=True)
    return np.ascontiguousarray(table[:, [2, 1, 0, 3]])


def paint(values: FloatArray, low: float, high: float, table: Colours) -> Colours:
    """Return `values` (nz, nx), row 0 the bottom, as pixels (nz, nx, 4), row 0 the top.

    Values outside [low, high] take the colour of the end, NaN is transparent.
    """
    seen = np.isfinite(values)
    share = (np.where(seen, values, low) - low) / (high - low)
    pixels = table[np.rint(255 * np.clip(share, 0.0, 1.0)).astype(np.uint8)]
    pixels[~seen] = 0
    return np.flipud(pixels)


def png(pixels: Colours) -> bytes:
    """Return pixels (rows, columns, 4), blue-green-red-alpha, as a PNG file."""
    done, data = cv2.imencode('.png', pixels)
    if not done:
        raise RuntimeError(f'no PNG could be made of {pixels.shape} pixels')
    return data.tobytes()


def forecast_of(snapshot: Snapshot) -> Map | None:
    """Return the newest forecast, the corrected one where there is one of the same time."""
    if not snapshot.predicted:
        return snapshot.corrected[-1] if snapshot.corrected else None
    newest = snapshot.predicted[-1]
    corrected = snapshot.corrected[-1] if snapshot.corrected else None
    return corrected if corrected is not None and corrected.time >= newest.time else newest


def difference_limit(difference: FloatArray) -> float:
    """Return the end of the scale that shows all but the largest 0.2 % of the differences.

    Not the very largest: a few bright grains of sand would take the colours from all others.
    """
    size = np.abs(difference[np.isfinite(difference)])
    most = float(np.quantile(size, 0.998)) if size.size else 0.0
    return next((limit for limit in DIFFERENCE_LIMITS if limit >= most), DIFFERENCE_LIMITS[-1])


def picture(snapshot: Snapshot, kind: Kind, theme: Theme) -> bytes | None:
    """Return the PNG of a map; None when there is none yet."""
    if kind == 'difference':
        if snapshot.difference is None:
            return None
        limit = difference_limit(snapshot.difference)
        return png(paint(snapshot.difference, -limit, limit, colour_table('difference', theme)))
    observed = snapshot.observation.map if snapshot.observation else None
    shown = observed if kind == 'observed' else forecast_of(snapshot)
    if shown is None:
        return None
    return png(paint(shown.concentration, 0.0, 1.0, colour_table('concentration', theme)))


def scale(kind: Kind, theme: Theme) -> bytes:
    """Return the colours of a scale, least to most, as a PNG of 256 x 1 pixels."""
    quantity: Literal['concentration', 'difference']
    quantity = 'difference' if kind == 'difference' else 'concentration'
    return png(colour_table(quantity, theme)[None])
