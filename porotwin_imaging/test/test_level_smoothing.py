"""Smoothing along levels: less noise, fronts and heights kept, and the stated noise is true."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.smoothing.denoising import denoised
from porotwin_imaging.smoothing.level_smoothing import smooth_along_levels

GRID = Grid(90, 60, 0.45, 0.3)
NOISE = np.full(GRID.shape, 0.02)


def disc(width: float = 0.01, height: float = 1.0) -> np.ndarray:
    x, z = np.meshgrid(GRID.x, GRID.z)
    distance = np.hypot(x - 0.2, z - 0.15) - 0.06
    return height * 0.5 * (1.0 - np.tanh(distance / width))


def both(truth: np.ndarray, visible: np.ndarray | None = None):
    """Return the denoised map, the smoothed one, and which cells are visible."""
    shown = np.ones(GRID.shape, bool) if visible is None else visible
    raw = truth + np.random.default_rng(3).normal(0.0, 0.02, GRID.shape)
    raw = np.where(shown, raw, np.nan)
    first = denoised(raw, NOISE, shown, GRID)
    return first, smooth_along_levels(raw, NOISE, first, GRID.dx)


def error(values: np.ndarray, truth: np.ndarray) -> float:
    known = np.isfinite(values)
    return float(np.linalg.norm((values - truth)[known]) / np.linalg.norm(truth[known]))


@pytest.mark.parametrize('width', [0.004, 0.01, 0.02])
def test_fronts_have_less_error_than_after_total_variation(width: float) -> None:
    truth = disc(width)
    first, found = both(truth)
    assert error(found.values, truth) < 0.9 * error(first, truth)


def test_a_pale_plume_keeps_its_height() -> None:
    truth = disc(height=0.3)
    first, found = both(truth)
    inside = truth > 0.295
    assert abs(first[inside].mean() - truth[inside].mean()) > 0.002
    assert abs(found.values[inside].mean() - truth[inside].mean()) < 0.001


def test_the_remaining_noise_is_as_stated() -> None:
    truth = disc(height=0.5)
    found = both(truth)[1]
    inside = truth > 0.49
    stated = float(np.sqrt(np.mean(found.noise[inside] ** 2)))
    assert np.std((found.values - truth)[inside]) == pytest.approx(stated, rel=0.5)
    assert stated < 0.004


def test_clean_sand_is_left_alone() -> None:
    first, found = both(np.zeros(GRID.shape))
    np.testing.assert_allclose(found.values, first, atol=1e-6)


def test_hidden_cells_stay_hidden_and_cost_nothing_beside_them() -> None:
    truth = disc()
    visible = np.ones(GRID.shape, bool)
    visible[:28] = False
    first, found = both(truth, visible)
    np.testing.assert_array_equal(np.isfinite(found.values), visible)
    np.testing.assert_array_equal(np.isfinite(found.noise), visible)
    assert error(found.values, truth) < error(first, truth)


def test_a_fine_map_is_corrected_on_coarser_cells() -> None:
    fine = Grid(900, 60, 4.5, 0.3)
    truth = np.broadcast_to(np.where(abs(fine.x - 1.0) < 0.03, 0.3, 0.0), fine.shape)
    raw = truth + np.random.default_rng(5).normal(0.0, 0.02, fine.shape)
    noise = np.full(fine.shape, 0.02)
    first = denoised(raw, noise, np.ones(fine.shape, bool), fine)
    found = smooth_along_levels(raw, noise, first, fine.dx)
    assert found.values.shape == fine.shape
    inside = abs(fine.x - 1.0) < 0.02
    lost, kept = (0.3 - values[:, inside].mean() for values in (first, found.values))
    assert lost > 0.0015
    assert abs(kept) < 0.5 * lost


@pytest.mark.parametrize('first_row', [0, 30])  # at the lower end of the rig, and within it
@pytest.mark.parametrize('rows', [(0.6, 1.0, 1.0, 1.0), (0.65, 0.98, 0.4, 0.6)])
def test_neighbours_of_a_thin_ridge_keep_their_heights(
    first_row: int, rows: tuple[float, ...]
) -> None:
    ridge = slice(first_row, first_row + len(rows))
    truth = np.zeros(GRID.shape)
    truth[ridge] = np.array(rows)[:, None]
    noise = np.where(truth > 0.9, 0.006, np.where(truth > 0.1, 0.035, 0.01))  # as in photographs
    raw = truth + noise * np.random.default_rng(3).normal(size=GRID.shape)
    first = denoised(raw, noise, np.ones(GRID.shape, bool), GRID)
    found = smooth_along_levels(raw, noise, first, GRID.dx)
    np.testing.assert_allclose(found.values[ridge].mean(axis=1), rows, atol=0.03)
