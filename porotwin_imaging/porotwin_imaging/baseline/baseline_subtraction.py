"""Subtracting the baseline: the log ratio of a photograph to its baseline, cell by cell.

The difference of two pictures is taken of their logarithms, r = ln(state / baseline). The own
brightness of the grains cancels, and a change of the light is a constant.
"""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT, BlockSums, CellSums
from porotwin_imaging.numerics.row_bands import row_bands
from porotwin_imaging.smoothing.map_deviation import NOISE

Array = NDArray[Any]


def log_ratio(state: Array, baseline: Array) -> Array:
    """Return ln(state / baseline) [-] of linear light; both (nz, nx, 3), 0 without samples."""
    return np.log(np.maximum(state, LEAST_LIGHT) / np.maximum(baseline, LEAST_LIGHT))


def cells_per_block(samples_across: int) -> int:
    """Return how many cells in each direction hold enough samples to estimate their scatter."""
    return math.ceil(NOISE.fewest_samples_across / samples_across)


def log_ratio_variance(
    sums: CellSums,
    matrix: Array,
    samples_across: int,
) -> Array:
    """Return the variance of the log ratio to the baseline, shape (nz, nx, 3 = red, green, blue).

    The variance is the one of a ratio estimator (Cochran, Sampling Techniques, sec. 6.4).

    Args:
        sums: sums over the samples of each cell.
        matrix: from colours of the camera to colours of the chart, shape (3, 3).
        samples_across: samples of a cell in each direction.
    """
    relative = _scatter(sums.blocks, matrix.astype(np.float32))
    nz, nx = sums.share.shape
    variance: Array = np.asarray(cv2.resize(relative, (nx, nz), interpolation=cv2.INTER_LINEAR))
    per_sample = np.float32(NOISE.correlated_samples / samples_across**2)
    for band in row_bands((nz, nx)):
        share = np.maximum(sums.share[band], VALIDITY.least_visible_share)
        variance[band] *= (per_sample / share)[..., None]
    return variance


def _scatter(blocks: BlockSums, matrix: Array) -> Array:
    """Return the relative variance of a sample about the ratio of its block, shape of the blocks.

    With state s, baseline b and ratio R = mean(s) / mean(b), the variance of a sample is
    mean(s^2) - 2 R mean(s b) + R^2 mean(b^2).
    """
    ratio = blocks.state / np.maximum(blocks.baseline, SMALLEST_DIVISOR)
    variance = blocks.state_square - 2 * ratio * blocks.product + ratio**2 * blocks.baseline_square
    share = np.maximum(blocks.share, VALIDITY.least_visible_share)[..., None]
    state = np.maximum(blocks.state @ matrix.T / share, LEAST_LIGHT)
    relative: Array = np.maximum(variance / share, 0.0) @ (matrix**2).T / state**2
    return relative
