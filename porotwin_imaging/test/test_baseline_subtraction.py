"""The log ratio to the baseline and its variance."""

import numpy as np
import pytest

from porotwin_imaging.baseline.baseline_subtraction import (
    cells_per_block,
    log_ratio,
    log_ratio_variance,
)
from porotwin_imaging.numerics.cell_sums import BlockSums, CellSums
from porotwin_imaging.smoothing.map_deviation import NOISE

SAMPLES_ACROSS = 8


def sums_of(state: np.ndarray, baseline: np.ndarray) -> CellSums:
    """Return the sums over samples, shape (nz, nx, samples, 3)."""
    products = (state, baseline, state**2, baseline**2, state * baseline)
    means = [product.mean(axis=2).astype(np.float32) for product in products]
    blocks = BlockSums(*means, np.ones(state.shape[:2], np.float32))
    return CellSums(log_ratio(blocks.state, blocks.baseline), blocks.share, blocks)


def test_grains_cancel() -> None:
    grains = np.random.default_rng(8).uniform(0.1, 0.5, (6, 7, 64, 3))
    variance = log_ratio_variance(sums_of(0.7 * grains, grains), np.eye(3), SAMPLES_ACROSS)
    assert variance.max() < 1e-6


def test_the_variance_is_the_spread_of_the_ratio_for_correlated_samples() -> None:
    generator = np.random.default_rng(9)
    grains = generator.uniform(0.1, 0.5, (60, 70, 64, 3))
    noisy = 0.7 * grains + generator.normal(0, 0.02, grains.shape)
    sums = sums_of(noisy, grains)
    variance = log_ratio_variance(sums, np.eye(3), SAMPLES_ACROSS)
    correlated = NOISE.correlated_samples
    assert variance.mean() == pytest.approx(correlated * sums.log_ratio.var(), rel=0.05)


def test_small_cells_are_pooled() -> None:
    assert cells_per_block(SAMPLES_ACROSS) == 1
    assert cells_per_block(1) == NOISE.fewest_samples_across
