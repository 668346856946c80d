"""Smoothing along the levels of a map: sharp fronts with less noise, and the noise that remains.

Total variation takes height from plumes (2 weight / r from a disc of radius r) and averages little
at a front. But neighbours on one level of concentration show the same value. Their raw values are
averaged, as a correction of a blurred map g, the guide:

    v_i = g_i + sum_j w_ij (f_j - g_j),   w_ij ~ exp(-|x_i - x_j|^2 / 2 h^2
                           - ((g_i - g_j)^2 + (u_i - u_j)^2 / 4) / 2 s_i^2) / s_j^2,

with raw values f, their standard deviations s, the denoised map u, and sum_j w_ij = 1. The average
runs far along a front and only over |g_i - g_j| < s across it. The term with u keeps the crest of a
thin ridge apart from its foot: the blur gives both the same g. It is a cross-bilateral filter of
the residual (Petschnigg et al., ACM Trans. Graph. 23:664, 2004). It is linear in f for a given
guide: the variance of the result is sum_j w_ij^2 s_j^2.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.geometry.sampling import SAMPLING
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS
from porotwin_imaging.tracer.calibration import CLEAN


@dataclass(frozen=True)
class LevelSmoothingSettings:
    """Smoothing along the levels of concentration (`level_smoothing.py`)."""

    reach_m: float = 0.015
    """Standard deviation of the average along a level [m]. A plume bends on a longer way."""
    reach_cells: tuple[float, float] = (1.5, 5.0)
    """Least and largest reach [cells]."""
    clean_reach: float = 2.3
    """Total variation averages clean sand further than a level, by this factor [-]."""
    guide_blur_m: float = 0.004
    """Blur of the map that gives the levels [m], so that they do not follow the noise."""
    guide_blur_cells: tuple[float, float] = (0.5, 1.5)
    """Least and largest blur [cells]: a front of two cells must stay."""


LEVEL_SMOOTHING = LevelSmoothingSettings()


Array = NDArray[Any]


@dataclass(frozen=True)
class SmoothedMap:
    """A map smoothed along its levels.

    Attributes:
        values: the map, shape (nz, nx), NaN where it is hidden.
        noise: standard deviation of `values` that the noise of the data leaves, same shape.
    """

    values: Array
    noise: Array


@dataclass(frozen=True)
class _Widths:
    """Widths [cells]: of the average along a level, and of the blur of the guide."""

    reach: float
    guide_blur: float

    @classmethod
    def of(cls, cell_m: float) -> Self:
        """Return the widths on cells of `cell_m` [m]."""
        return cls(
            float(np.clip(LEVEL_SMOOTHING.reach_m / cell_m, *LEVEL_SMOOTHING.reach_cells)),
            float(
                np.clip(LEVEL_SMOOTHING.guide_blur_m / cell_m, *LEVEL_SMOOTHING.guide_blur_cells)
            ),
        )


def smooth_along_levels(
    raw: Array,
    noise: Array,
    first: Array,
    cell_m: float,
) -> SmoothedMap:
    """Return the map smoothed along its levels.

    Fine maps are corrected on coarser cells: averages over many cells need no fine ones.

    Args:
        raw: raw concentration, shape (nz, nx), NaN where it is hidden.
        noise: its standard deviation, same shape.
        first: the denoised map, which gives the levels, same shape.
        cell_m: size of a cell [m].
    """
    visible = np.isfinite(raw) & np.isfinite(first)
    factor = max(1, round(first.shape[1] / SAMPLING.judged_columns))
    nz, nx = (max(1, size // factor) for size in first.shape)
    filled = [np.where(visible, plane, 0.0) for plane in (raw, first, noise**2)]
    share, data, guide, variance = (
        _coarse(np.asarray(plane, np.float32), (nz, nx)) for plane in (visible, *filled)
    )
    seen = share > VALIDITY.least_visible_share
    data, guide, variance = (
        plane / np.maximum(share, VALIDITY.least_visible_share) for plane in (data, guide, variance)
    )
    variance = np.maximum(variance * (nz * nx / first.size), SMALLEST_DIVISOR)
    widths = _Widths.of(cell_m * factor)
    correction, remaining = _corrections(data, guide, variance, seen, widths)
    if factor > 1:
        size = first.shape[::-1]
        correction = cv2.resize(correction, size, interpolation=cv2.INTER_LINEAR)
        remaining = cv2.resize(remaining, size, interpolation=cv2.INTER_LINEAR)
    values = np.clip(np.where(visible, first + correction, np.nan), 0.0, 1.0)
    return SmoothedMap(values, np.where(visible, np.sqrt(remaining), np.nan))


def _coarse(plane: Array, shape: tuple[int, int]) -> Array:
    """Return the means of `plane` on a grid of `shape`."""
    return np.asarray(cv2.resize(plane, shape[::-1], interpolation=cv2.INTER_AREA))


def _corrections(
    data: Array,
    first: Array,
    variance: Array,
    seen: NDArray[np.bool_],
    widths: _Widths,
) -> tuple[Array, Array]:
    """Return what is added to `first`, and the variance of the result, each (nz, nx), float32.

    Far from tracer nothing is added: the average would only add noise.
    """
    reach = math.ceil(2.0 * widths.reach)
    weight = np.maximum(_blurred(seen, widths.guide_blur), SMALLEST_DIVISOR)
    guide = _blurred(np.where(seen, first, 0.0), widths.guide_blur) / weight
    window = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    tracer = cv2.dilate((guide > CLEAN).astype(np.uint8), window) > 0
    smooth, remaining = _average_on_levels(
        (data - guide).astype(np.float32),
        variance.astype(np.float32),
        seen,
        guide.astype(np.float32),
        first.astype(np.float32),
        tracer,
        np.float32(widths.reach),
        reach,
    )
    clean = variance / (4.0 * math.pi * (LEVEL_SMOOTHING.clean_reach * widths.reach) ** 2)
    correction = np.where(tracer, guide + smooth - first, 0.0)
    return correction.astype(np.float32), np.where(tracer, remaining, clean).astype(np.float32)


def _blurred(plane: Array, width: float) -> Array:
    """Return `plane` (nz, nx) blurred by `width` [cells].

    Beyond the rim the cells repeat. OpenCV's default mirrors them about the outermost ones, so that
    the second row would count twice, and its level be taken for that of the first.
    """
    values = np.asarray(plane, np.float32)
    return np.asarray(cv2.GaussianBlur(values, (0, 0), width, borderType=cv2.BORDER_REFLECT))


@njit(cache=True, nogil=True)
def _average_on_levels(
    residual: NDArray[np.float32],
    variance: NDArray[np.float32],
    seen: NDArray[np.bool_],
    guide: NDArray[np.float32],
    denoised: NDArray[np.float32],
    wanted: NDArray[np.bool_],
    width: np.float32,
    reach: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the weighted averages of `residual` and their variances where `wanted`, (nz, nx)."""
    nz, nx = guide.shape
    average = np.zeros((nz, nx), np.float32)
    remaining = variance.copy()
    for i in range(nz):
        for j in range(nx):
            if not wanted[i, j]:
                continue
            total, weights, squares = 0.0, 0.0, 0.0
            for k in range(max(0, i - reach), min(nz, i + reach + 1)):
                for m in range(max(0, j - reach), min(nx, j + reach + 1)):
                    if not seen[k, m]:
                        continue
                    apart = guide[k, m] - guide[i, j]
                    differs = denoised[k, m] - denoised[i, j]
                    levels = (apart * apart + 0.25 * differs * differs) / variance[i, j]
                    exponent = 0.5 * (((k - i) ** 2 + (m - j) ** 2) / width**2 + levels)
                    if exponent > 0.5 * NOISE_SPREADS**2:
                        continue
                    weight = math.exp(-exponent) / variance[k, m]
                    total += weight * residual[k, m]
                    weights += weight
                    squares += weight * weight * variance[k, m]
            if weights > 0.0:
                average[i, j] = total / weights
                remaining[i, j] = squares / weights**2
    return average, remaining
