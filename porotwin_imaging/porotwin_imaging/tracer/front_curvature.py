"""Fronts across a cell: the mean of a bent signal is not the signal of the mean concentration.

A cell shows the mean of the log of light over its tiles, and a tile the mean of its light
(`cell_sums`). Let A(c) be the absorbance of the concentration c, and n the tiles across a cell. A
front with the slope s per cell has the variance s^2 / 12 in a cell, and s^2 / (12 n^2) in a tile.
To second order the cell then reads

    c + (A'' / A' - A' / n^2) s^2 / 24

This is taken back. The dye and the contrast give A; it is a polynomial here, because the table of a
response has corners.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.numerics.cell_sums import tile_of
from porotwin_imaging.tracer.calibration import Calibration

Array = NDArray[Any]

_POINTS = np.linspace(0.0, 1.0, 33)
_DEGREE = 3
_LEAST_LIGHT = 0.05
"""Light is raised to this before its logarithm: less tells no concentration."""
_MOST = 3.0
"""Largest factor on the squared slope; stronger curvature is no response that fronts show."""
_LEAST_SLOPE = 0.1
"""A' is raised to this before it divides [-]."""
_FEWEST_SAMPLES = 4
"""Smaller cells hardly contain a front."""
_NEIGHBOURS = np.ones((3, 3), np.uint8)


def without_curvature(values: Array, calibration: Calibration, samples_across: int) -> Array:
    """Return a map (nz, nx) without the bend that fronts across a cell cause, float32.

    A value stays between its neighbours. NaN stays NaN.

    Args:
        values: concentration, NaN where it is hidden.
        calibration: its response and contrast.
        samples_across: samples of the photograph across a cell.
    """
    if samples_across < _FEWEST_SAMPLES:
        return values
    known = np.isfinite(values)
    filled = np.where(known, values, np.float32(0.0)).astype(np.float32)
    inside = cv2.erode(known.astype(np.uint8), _NEIGHBOURS) > 0
    up, across = np.gradient(filled)
    curvature = _curvature(calibration, samples_across // tile_of(samples_across))
    factor = np.interp(filled, _POINTS, curvature).astype(np.float32)
    moved = filled - factor * (up**2 + across**2) / np.float32(24.0)
    limited = np.clip(moved, cv2.erode(filled, _NEIGHBOURS), cv2.dilate(filled, _NEIGHBOURS))
    return np.where(inside, limited, values).astype(np.float32)


def _curvature(calibration: Calibration, tiles: int) -> Array:
    """Return A'' / A' - A' / n^2 at `_POINTS`."""
    response = calibration.response
    signal = np.interp(_POINTS, response.concentration, response.signal)
    if calibration.signal.contrast == 'difference':
        signal = -np.log(np.maximum(1.0 - signal, _LEAST_LIGHT))
    absorbance = np.polynomial.Polynomial.fit(_POINTS, signal, _DEGREE)
    slope = np.maximum(absorbance.deriv()(_POINTS), _LEAST_SLOPE)
    bent = absorbance.deriv(2)(_POINTS) / slope - slope / tiles**2
    return np.asarray(np.clip(bent, -_MOST, _MOST))
