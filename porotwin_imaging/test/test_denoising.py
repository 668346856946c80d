"""Data weights of the denoising, and its limits."""

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.smoothing.denoising import data_weights, denoised


def test_a_cell_of_median_noise_has_weight_one() -> None:
    noise = np.array([[0.01, 0.01, 0.02, 0.04]])
    visible = np.array([[True, True, True, False]])
    np.testing.assert_allclose(data_weights(noise, visible), [[1.0, 1.0, 0.5, 0.0]])
    assert not data_weights(noise, np.zeros_like(visible)).any()


def test_hidden_cells_stay_hidden_and_values_stay_between_zero_and_one() -> None:
    raw = np.random.default_rng(6).normal(0.0, 0.1, (20, 30))
    visible = np.ones(raw.shape, bool)
    visible[5:9, 7:12] = False
    raw[~visible] = np.nan
    values = denoised(raw, np.full(raw.shape, 0.1), visible, Grid(30, 20, 0.3, 0.2))
    np.testing.assert_array_equal(np.isfinite(values), visible)
    assert np.nanmin(values) >= 0.0
    assert np.nanmax(values) <= 1.0
