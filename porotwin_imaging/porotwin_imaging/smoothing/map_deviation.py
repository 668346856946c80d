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
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS
from porotwin_imaging.numerics.row_bands import by_overlapping_bands
from porotwin_imaging.smoothing.level_smoothing import SmoothedMap
from porotwin_imaging.tracer.calibration import Calibration


@dataclass(frozen=True)
class NoiseSettings:
    """Standard deviation of a map (`baseline_subtraction.py`, `denoising.py`)."""

    correlated_samples: float = 3.3
    """Neighbouring samples that share one error, because JPEG and interpolation smear it."""
    fewest_samples_across: int = 5
    """Samples in each direction needed to estimate the scatter; smaller cells are pooled."""
    remaining_noise: float = 0.77
    """Noise of a map relative to the noise that is propagated through its steps [-]. Samples share
    less of it than assumed. Fitted to composed photographs, as are the next two."""
    place_error: float = 3e-4
    """Standard deviation of the place of a cell relative to the width of the rig [-]: half a pixel
    of 1600, from alignment and from corners that a person reads off. On the large FluidFlower, the
    lines of a laser grid deviate by 1.0 mm on 2.8 m, 3.6e-4."""
    blur_cells: float = 0.21
    """Standard deviation of the blur of a front that is left in a map, or that was taken back too
    much [cells]: 1.2 px on composed photographs with 5.5 px per cell."""
    credible: tuple[float, float] = (-0.5, 1.5)
    """Concentrations are clipped to this range before denoising [-]. Values beyond it are noise of
    a single cell and must not spread."""


NOISE = NoiseSettings()


Array = NDArray[Any]

_LEVELS = 4096
"""Steps of concentration in the table of errors: from one to the next they change by less than
1e-4."""
_REACH = 2
"""A deviation depends on so many rows to either side: a difference, and the mean around it."""
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
) -> MapDeviation:
    """Return the deviation of a map.

    Args:
        smoothed: the map and the rest of its noise.
        light_error: standard deviation of concentrations from wrong light, (nz, nx) or a number.
        calibration: conversion of signal to concentration, with its deviations.
        grid: the grid of the map.
    """
    if np.ndim(light_error) == 0:
        light_error = np.full(grid.shape, light_error, np.float32)

    table = _CalibrationErrors.of(calibration)

    def band(values: Array, noise: Array, light_error: Array, factor: Array) -> tuple[Array, Array]:
        left = np.float32(NOISE.remaining_noise) * noise
        random = (left**2 + light_error**2).astype(np.float32)
        random += _clean_or_faint(values, random)
        known = np.isfinite(values)
        filled = np.where(known, values, np.float32(0.0))
        systematic = (
            table.squares(filled, factor)
            + np.float32(NOISE.place_error * grid.width) ** 2 * _slope(filled, known, grid)
            + np.float32(0.5 * NOISE.blur_cells**2) ** 2 * _bend(filled, known)
        )
        systematic = np.where(known, np.minimum(systematic, _LARGEST), np.float32(np.nan))
        return np.sqrt(np.minimum(random + systematic, _LARGEST)), np.sqrt(systematic)

    total, systematic = by_overlapping_bands(
        band,
        _REACH,
        smoothed.values.astype(np.float32),
        smoothed.noise,
        np.asarray(light_error),
        calibration.factor_deviation_map(grid),
    )
    return MapDeviation(total, systematic)


def _clean_or_faint(values: Array, random: Array) -> Array:
    """Return the variance of faint values, which may be tracer or clean sand with noise.

    With even odds the value v is v or 0, and its variance v^2 / 4. `random` is the variance of the
    noise.
    """
    squares = values * np.abs(values)  # values below 0 are faint
    return np.where(squares < NOISE_SPREADS**2 * random, 0.25 * values**2, np.float32(0.0))


@dataclass(frozen=True)
class _CalibrationErrors:
    """Squares of the errors that the calibration causes, by concentration from 0 to 1.

    Attributes:
        common: without the factor of the sand, shape (_LEVELS + 1,).
        by_factor: the rest, relative to the squared deviation of the factor, same shape.
    """

    common: Array
    by_factor: Array

    @classmethod
    def of(cls, calibration: Calibration) -> Self:
        """Return the table of a calibration."""
        response = calibration.response
        levels = np.linspace(0.0, 1.0, _LEVELS + 1)
        signal = np.interp(levels, response.concentration, response.signal)
        common, whole = (
            calibration.systematic_deviation(signal, np.full_like(signal, factor)) ** 2
            for factor in (0.0, 1.0)
        )
        return cls(common.astype(np.float32), (whole - common).astype(np.float32))

    def squares(self, values: Array, factor_deviation: Array) -> Array:
        """Return the squared errors of concentrations, float32, of the same shape."""
        level = (np.clip(values, 0.0, 1.0) * _LEVELS + 0.5).astype(np.int32)
        squares = self.common[level]
        if factor_deviation.any():
            squares += self.by_factor[level] * np.asarray(factor_deviation, np.float32) ** 2
        return squares


def _slope(values: Array, known: NDArray[np.bool_], grid: Grid) -> Array:
    """Return the mean square slope around each cell (nz, nx) [1/m^2], 0 where not known."""
    across = _difference(values, known, 1) / np.float32(grid.dx)
    up = _difference(values, known, 0) / np.float32(grid.dz)
    return _around(across**2 + up**2)


def _difference(values: Array, known: NDArray[np.bool_], axis: int) -> Array:
    """Return the central difference per cell along `axis`, 0 beside cells that are not known."""
    found = np.gradient(values, axis=axis)
    certain = _neighbours_known(known)
    return np.where(certain, found, np.float32(0.0))


def _bend(values: Array, known: NDArray[np.bool_]) -> Array:
    """Return the mean square Laplacian around each cell (nz, nx) [1/cell^4]."""
    single = values.astype(np.float32)
    bend = np.abs(cv2.Laplacian(single, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE))
    return _around(np.where(_neighbours_known(known), bend, np.float32(0.0)) ** 2)


def _around(square: Array) -> Array:
    """Return the mean of `square` (nz, nx) over a cell and its eight neighbours."""
    return np.maximum(cv2.blur(square, (3, 3), borderType=cv2.BORDER_REPLICATE), 0.0)


def _neighbours_known(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a cell and its eight neighbours are known."""
    return cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
