"""Denoising a concentration map: data weights from the noise."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.numerics.row_bands import by_bands
from porotwin_imaging.smoothing.total_variation import fill, total_variation_denoising

Array = NDArray[Any]

_LEAST_VISIBLE_WEIGHT = 0.5
"""Smallest data weight of a visible cell [-]: dark stock is noisier than water in absorbance, but
must not lose more of its height, which is inverse to the weight."""


def denoised(
    concentration: Array,
    noise: Array,
    visible: NDArray[np.bool_],
    grid: Grid,
) -> Array:
    """Return the denoised concentration (nz, nx), from 0 to 1, NaN in cells that are not visible.

    Args:
        concentration: raw concentration, shape (nz, nx).
        noise: its standard deviation, same shape.
        visible: cells that show their sand, same shape.
        grid: the grid of the map.
    """
    # hidden cells only continue the map and are removed again, so their weight is 1
    smooth = total_variation_denoising(
        fill(concentration, visible.astype(np.float32)),
        np.where(visible, data_weights(noise, visible), 1.0),
        spacing=(grid.dz, grid.dx),
    )
    return np.where(visible, np.clip(smooth.values, 0.0, 1.0), np.nan)


def data_weights(noise: Array, visible: NDArray[np.bool_]) -> Array:
    """Return the data weights (nz, nx) of the denoising: min((median noise / noise)^2, 1).

    Weights of visible cells are at least 0.5. A cell of median noise has the weight 1, so that the
    total variation weight has the same effect in every photograph. Hidden cells have the weight 0.
    """
    if not visible.any():
        return np.zeros_like(noise)
    median = float(np.median(noise[visible]))

    def band(noise: Array, visible: Array) -> tuple[Array]:
        weights = (median / np.maximum(noise, SMALLEST_DIVISOR)) ** 2
        return (np.where(visible, np.clip(weights, _LEAST_VISIBLE_WEIGHT, 1.0), 0.0),)

    (weights,) = by_bands(band, noise, visible)
    return weights
