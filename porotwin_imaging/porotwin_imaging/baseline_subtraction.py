"""Subtracting the baseline: the log ratio of a photograph to its baseline, cell by cell.

The difference of two pictures is taken of their logarithms, r = ln(state / baseline). The own
brightness of the grains cancels, and a change of the light is a constant.

A front of tracer crosses a cell. The mean of the light is then no measure of the mean tracer,
because the bright part outshines the dark one: half stock and half water look like a quarter of
stock. The mean of the logarithm is a measure. Single pixels are noisy and feel every small blur, so
the logarithm is taken over blocks of two or three samples, and averaged over the blocks of a cell.
"""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.cell_sums import BlockSums, CellSums
from porotwin_imaging.row_bands import by_bands
from porotwin_imaging.settings import DEFAULTS, NoiseSettings

Array = NDArray[Any]

_LEAST_LIGHT = 1e-5
"""Linear light is raised to this before the logarithm."""
_LEAST_STATE = 1e-4
"""Linear light is raised to this before it divides a variance."""
_LEAST_SHARE = 0.05
"""Visible share of a cell is raised to this before it divides."""
_SMALLEST_DIVISOR = 1e-6


_BLOCK_SAMPLES = (3, 2)
"""Samples across a block in the order of preference: enough to average grains and noise, and finer
than a front."""


def blocks_across(samples_across: int) -> int:
    """Return the blocks of a cell in each direction whose log ratios are averaged.

    1 if the samples of the cell do not divide into blocks of two or three.
    """
    for size in _BLOCK_SAMPLES:
        if samples_across % size == 0:
            return samples_across // size
    return 1


def log_ratio(state: Array, baseline: Array) -> Array:
    """Return ln(state / baseline) [-] of linear light; both (nz, nx, 3), 0 without samples."""
    return np.log(np.maximum(state, _LEAST_LIGHT) / np.maximum(baseline, _LEAST_LIGHT))


def cells_per_block(samples_across: int, settings: NoiseSettings = DEFAULTS.noise) -> int:
    """Return how many cells in each direction hold enough samples to estimate their scatter."""
    return math.ceil(settings.fewest_samples_across / samples_across)


def subtract_baseline(
    sums: CellSums,
    matrix: Array,
    samples_across: int,
    settings: NoiseSettings = DEFAULTS.noise,
) -> tuple[Array, Array]:
    """Return the log ratio to the baseline and its variance, each (nz, nx, 3 = red, green, blue).

    The ratio of the sums over a block weights every grain by its own light. The variance is that of
    a ratio estimator (Cochran, Sampling Techniques, sec. 6.4). The colour matrix acts on the means
    of the blocks, which equals its action on every pixel because it is linear.

    Args:
        sums: means over the samples of each block, with `blocks_across(samples_across)` blocks in
            each direction of a cell.
        matrix: from colours of the camera to colours of the chart, shape (3, 3).
        samples_across: samples of a cell in each direction.
        settings: correlation and pooling of samples.
    """
    matrix = matrix.astype(np.float32)
    cell_share = _cell_means(sums.share, blocks_across(samples_across))
    nz, nx = cell_share.shape
    relative = _scatter(sums.blocks, matrix)
    variance = np.asarray(cv2.resize(relative, (nx, nz), interpolation=cv2.INTER_LINEAR))
    per_sample = np.float32(settings.correlated_samples / samples_across**2)

    def band(state: Array, before: Array) -> tuple[Array]:
        return (log_ratio(*(cv2.transform(light, matrix) for light in (state, before))),)

    def scaled(variance: Array, share: Array) -> tuple[Array]:
        return (variance * (per_sample / np.maximum(share, _LEAST_SHARE))[..., None],)

    (ratio,) = by_bands(band, sums.state, sums.baseline)
    (variance,) = by_bands(scaled, variance, cell_share)
    return _mean_over_blocks(ratio, sums.share, cell_share), variance


def cells_of_blocks(sums: CellSums, blocks: int) -> CellSums:
    """Return the means over cells of `blocks` x `blocks` blocks each; moments stay as they are."""
    if blocks == 1:
        return sums
    means = (_cell_means(plane, blocks) for plane in (sums.state, sums.baseline, sums.share))
    return CellSums(*means, sums.blocks)


def _cell_means(plane: Array, blocks: int) -> Array:
    """Return the means of `plane` over cells of `blocks` x `blocks` blocks each."""
    if blocks == 1:
        return plane
    size = (plane.shape[1] // blocks, plane.shape[0] // blocks)
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA))


def _mean_over_blocks(values: Array, share: Array, cell_share: Array) -> Array:
    """Return the mean of `values` over the blocks of each cell, weighted by their visible share."""
    blocks = values.shape[0] // cell_share.shape[0]
    if blocks == 1:
        return values
    weighted = _cell_means(values * share[..., None], blocks)
    return weighted / np.maximum(cell_share, _LEAST_SHARE)[..., None]


def _scatter(blocks: BlockSums, matrix: Array) -> Array:
    """Return the relative variance of a sample about the ratio of its block, shape of the blocks.

    With state s, baseline b and ratio R = mean(s) / mean(b), the variance of a sample is
    mean(s^2) - 2 R mean(s b) + R^2 mean(b^2).
    """
    ratio = blocks.state / np.maximum(blocks.baseline, _SMALLEST_DIVISOR)
    variance = blocks.state_square - 2 * ratio * blocks.product + ratio**2 * blocks.baseline_square
    share = np.maximum(blocks.share, _LEAST_SHARE)[..., None]
    state = np.maximum(blocks.state @ matrix.T / share, _LEAST_STATE)
    relative: Array = np.maximum(variance / share, 0.0) @ (matrix**2).T / state**2
    return relative
