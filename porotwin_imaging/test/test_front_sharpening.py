"""Sharpening of fronts: the blur of the camera is taken back, and nothing is invented."""

import cv2
import numpy as np
import pytest

from porotwin_core.geometry.grid import conservative_resample
from porotwin_imaging.smoothing.front_sharpening import blur_in_cells, sharpened
from porotwin_imaging.smoothing.level_smoothing import SmoothedMap

CELLS, FINER = 80, 8
BLUR = (0.35, 0.3)


def disc(*, blurred: bool, height: float = 1.0, rim: float = 0.8) -> np.ndarray:
    """Return means over cells of a disc with a rim of `rim` cells, seen with the blur or not."""
    side = CELLS * FINER
    z, x = np.indices((side, side), np.float64) / FINER - CELLS / 2
    fine = height * 0.5 * (1 - np.tanh((np.hypot(x, z) - 25) / rim))
    if blurred:
        fine = cv2.GaussianBlur(fine, (0, 0), sigmaX=BLUR[1] * FINER, sigmaY=BLUR[0] * FINER)
    return conservative_resample(fine, (CELLS, CELLS))


def of(values: np.ndarray, noise: float = 0.0) -> SmoothedMap:
    return SmoothedMap(values, np.full(values.shape, noise))


@pytest.mark.parametrize('rim', [0.8, 1.5, 3.0])
def test_the_blur_of_a_front_is_taken_back(rim: float) -> None:
    truth, seen = disc(blurred=False, rim=rim), disc(blurred=True, rim=rim)
    found = sharpened(of(seen), BLUR).values
    assert np.linalg.norm(found - truth) < 0.5 * np.linalg.norm(seen - truth)
    assert found.sum() == pytest.approx(truth.sum(), rel=1e-3)


def test_fronts_as_sharp_as_the_blur_are_taken_back_as_well() -> None:
    truth, seen = disc(blurred=False, rim=0.3), disc(blurred=True, rim=0.3)
    found = sharpened(of(seen), BLUR).values
    high = (truth > 0.5) & (truth < 0.9)
    assert (seen - truth)[high].mean() < -0.04
    assert abs((found - truth)[high].mean()) < 0.015


@pytest.mark.parametrize('height', [0.3, 1.0])
def test_plateaus_keep_their_height_and_fronts_do_not_overshoot(height: float) -> None:
    found = sharpened(of(disc(blurred=True, height=height)), BLUR).values
    assert found.max() <= height + 1e-6
    assert found.min() >= 0.0
    assert found[40, 40] == pytest.approx(height, abs=1e-6)


def test_noise_in_clean_sand_does_not_rise() -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.01, (CELLS, CELLS))
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    found = sharpened(of(smooth), BLUR).values
    assert found.std() < 1.1 * smooth.std()


def test_the_stated_noise_is_not_below_that_of_independent_cells() -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.01, (CELLS, CELLS))
    found = sharpened(of(noise, 0.01), BLUR)
    assert found.values.std() < np.median(found.noise) < 1.6 * 0.01


def test_hidden_cells_stay_hidden_and_do_not_darken_their_neighbours() -> None:
    values = np.full((12, 12), 0.7)
    values[4:7, 5:8] = np.nan
    found = sharpened(of(values), BLUR).values
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    np.testing.assert_allclose(found[np.isfinite(found)], 0.7, atol=1e-6)


def test_the_blur_vanishes_in_large_cells_and_grows_with_coarse_decoding() -> None:
    up, across = blur_in_cells((10.0, 20.0), 1)
    assert up == pytest.approx(2 * across)
    assert blur_in_cells((200.0, 200.0), 1)[0] < 0.01
    assert blur_in_cells((5.0, 5.0), 2)[0] > blur_in_cells((10.0, 10.0), 1)[0]
