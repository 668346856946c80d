"""The standard deviation of every value of a map: a random and a systematic part.

| error | part | estimated from |
| --- | --- | --- |
| noise of the photograph, after denoising | random | scatter of the samples, `level_smoothing` |
| faint values that may be clean sand | random | the noise |
| light that is not that of the baseline | random | colours that tracer does not have |
| scale, response and sands | systematic | the calibration |
| place: corners of the rig, curvature, alignment | systematic | slope of the map |
| blur of lens, cells and denoising | systematic | bend of the map |

Systematic errors stay the same from photograph to photograph. The parts are independent and are
added in squares.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import Grid
from porotwin_imaging.calibration import Calibration
from porotwin_imaging.level_smoothing import SmoothedMap
from porotwin_imaging.row_bands import by_bands
from porotwin_imaging.settings import DEFAULTS, NoiseSettings

Array = NDArray[Any]

_LARGEST_FAINT = 3.0
"""Values above this many standard deviations are tracer, not clean sand."""
_LARGEST = 1.0
"""Largest deviation of a value between 0 and 1 [-]; more says nothing more."""


@dataclass(frozen=True)
class MapDeviation:
    """Standard deviations of a map, shape (nz, nx), NaN where the map is NaN.

    Attributes:
        total: of random and systematic errors together.
        systematic: of the errors that stay the same from photograph to photograph.
    """

    total: Array
    systematic: Array


def map_deviation(
    smoothed: SmoothedMap,
    light_error: Array | float,
    calibration: Calibration,
    grid: Grid,
    settings: NoiseSettings = DEFAULTS.noise,
) -> MapDeviation:
    """Return the deviation of a map.

    Args:
        smoothed: the map and what remains of its noise.
        light_error: standard deviation of concentrations from wrong light, (nz, nx) or a number.
        calibration: conversion of signal to concentration, with its deviations.
        grid: the grid of the map.
        settings: errors of the place and of the light.
    """
    values = smoothed.values.astype(np.float32)
    noise = np.hypot(smoothed.noise, light_error).astype(np.float32)
    random = np.hypot(noise, _clean_or_faint(values, noise))
    known = np.isfinite(values)
    filled = np.where(known, values, np.float32(0.0))
    systematic = np.sqrt(
        _calibration_error(filled, calibration, grid) ** 2
        + (settings.place_error * grid.width * _slope(filled, known, grid)) ** 2
        + (0.5 * settings.blur_cells**2 * _bend(filled, known)) ** 2
    )
    systematic = np.where(known, np.minimum(systematic, _LARGEST), np.nan)
    return MapDeviation(np.minimum(np.hypot(random, systematic), _LARGEST), systematic)


def _clean_or_faint(values: Array, noise: Array) -> Array:
    """Return the deviation of faint values, which may be tracer or clean sand with noise.

    With even odds the value is v or 0, and its standard deviation v / 2.
    """
    faint = values < _LARGEST_FAINT * noise
    return np.where(faint, 0.5 * values, 0.0)


def _calibration_error(values: Array, calibration: Calibration, grid: Grid) -> Array:
    """Return the standard deviation of `values` (nz, nx) that the calibration causes."""
    response = calibration.response

    def band(values: Array, factor_deviation: Array) -> tuple[Array]:
        signal = np.interp(values, response.concentration, response.signal)
        deviation = calibration.systematic_deviation(signal, factor_deviation)
        return (deviation.astype(np.float32),)

    return by_bands(band, values, calibration.factor_deviation_map(grid))[0]


def _slope(values: Array, known: NDArray[np.bool_], grid: Grid) -> Array:
    """Return the root mean square slope around each cell (nz, nx) [1/m], 0 where not known."""
    across = _difference(values, known, 1) / grid.dx
    up = _difference(values, known, 0) / grid.dz
    return _around(across**2 + up**2)


def _difference(values: Array, known: NDArray[np.bool_], axis: int) -> Array:
    """Return the central difference per cell along `axis`, 0 beside cells that are not known."""
    found = np.gradient(values, axis=axis)
    certain = _neighbours_known(known)
    return np.where(certain, found, 0.0)


def _bend(values: Array, known: NDArray[np.bool_]) -> Array:
    """Return the root mean square Laplacian around each cell (nz, nx) [1/cell^2]."""
    single = values.astype(np.float32)
    bend = np.abs(cv2.Laplacian(single, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE))
    return _around(np.where(_neighbours_known(known), bend, 0.0) ** 2)


def _around(square: Array) -> Array:
    """Return the root of the mean of `square` (nz, nx) over a cell and its eight neighbours."""
    mean = cv2.blur(square, (3, 3), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(np.sqrt(np.maximum(mean, 0.0)))


def _neighbours_known(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a cell and its eight neighbours are known."""
    return cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
