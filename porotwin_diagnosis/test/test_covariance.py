"""The covariance of fitted parameters with correlated residuals."""

import numpy as np
import pytest

from porotwin_diagnosis.model.covariance import TILE, clustered_covariance

ROWS, COLUMNS = 8, 12
"""Tiles of the problem each way."""


def problem(seed=5):
    """Return slopes (2, 4, 40, 60) and residuals (4, 40, 60) that are constant within every tile.

    Both are standard normal from tile to tile, and the same in all four frames.
    """
    generator = np.random.default_rng(seed)

    def tiles(count):
        values = generator.standard_normal((count, ROWS, COLUMNS))
        return np.kron(values, np.ones((TILE, TILE)))[:, None].repeat(4, axis=1)

    return tiles(2), tiles(1)[0]


def test_a_tile_counts_as_one_observation():
    """The variance is 1 / 96 for 96 tiles, whatever the number of cells and frames in a tile."""
    covariances = []
    for seed in range(40):
        slopes, residual = problem(seed)
        covariances.append(np.diag(clustered_covariance([slopes], [residual])))
    assert np.mean(covariances) == pytest.approx(1.0 / (ROWS * COLUMNS), rel=0.1)


def test_recordings_add_their_information():
    slopes, residual = problem()
    one = clustered_covariance([slopes], [residual])
    two = clustered_covariance([slopes] * 2, [residual] * 2)
    np.testing.assert_allclose(two, one / 2, rtol=1e-6)


def test_a_parameter_without_response_gets_a_finite_covariance():
    slopes, residual = problem()
    slopes[1] = 0.0
    assert np.isfinite(clustered_covariance([slopes], [residual])).all()
