"""The covariance of fitted parameters when residuals are correlated.

Neighbouring pixels and successive frames share errors, so they are not independent observations.
The sandwich estimator takes the residuals of a tile over all frames as one observation:

    cov = N^-1 (sum over tiles s s^T) N^-1,   N = J^T J,   s = J_tile^T r_tile

(Liang & Zeger, Biometrika 73 (1986) 13).
"""

from collections.abc import Sequence

import numpy as np

from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray

TILE = 5
"""Compared cells per side of a tile: 10 cells of the recording, several widths of the smoothing."""


def clustered_covariance(
    slopes: Sequence[FloatArray], residuals: Sequence[FloatArray]
) -> FloatArray:
    """Return the covariance (p, p) of the scaled parameters.

    Args:
        slopes: minus the derivatives of the residuals, (p, nt, nz', nx') per recording.
        residuals: whitened residuals, (nt, nz', nx') per recording.
    """
    size = len(slopes[0])
    normal = np.zeros((size, size))
    spread = np.zeros_like(normal)
    for residual, columns in zip(residuals, slopes, strict=True):
        flat = columns.reshape(size, -1)
        normal += flat @ flat.T
        scores = _tile_sums(columns * residual)
        spread += scores @ scores.T
    # the ridge bounds parameters that change nothing
    inverse = np.linalg.pinv(normal + ROUND_OFF * np.trace(normal) * np.eye(size))
    return inverse @ spread @ inverse


def _tile_sums(values: FloatArray) -> FloatArray:
    """Return the sums of `values` (p, nt, nz, nx) over all frames of every tile, (p, tiles)."""
    total = values.sum(axis=1)
    rows = np.add.reduceat(total, np.arange(0, total.shape[1], TILE), axis=1)
    tiles = np.add.reduceat(rows, np.arange(0, rows.shape[2], TILE), axis=2)
    return tiles.reshape(len(values), -1)
