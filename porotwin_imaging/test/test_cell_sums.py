"""Means over cells, against the same means by numpy."""

import numpy as np
import pytest

from porotwin_imaging.baseline.baseline_subtraction import log_ratio
from porotwin_imaging.numerics.cell_sums import CellSums, cell_sums
from porotwin_imaging.photograph.linear_light import LINEAR_LIGHT, linear_light

SAMPLES_ACROSS = 3
IDENTITY = np.eye(3)
NZ, NX = 4, 5


@pytest.fixture
def sampled() -> tuple[np.ndarray, np.ndarray]:
    """Return a sampled photograph and baseline."""
    generator = np.random.default_rng(19)
    shape = (NZ * SAMPLES_ACROSS, NX * SAMPLES_ACROSS, 3)
    pixels = generator.integers(0, 240, shape, dtype=np.uint8)
    return pixels, generator.random(shape).astype(np.float32)


def sums_of(
    pixels: np.ndarray,
    baseline: np.ndarray,
    usable: np.ndarray,
    cells_across: int = 1,
    matrix: np.ndarray = IDENTITY,
) -> CellSums:
    return cell_sums(
        pixels, baseline, usable,
        light=LINEAR_LIGHT, matrix=matrix, glare_level=250, samples_across=SAMPLES_ACROSS,
        cells_across=cells_across,
    )  # fmt: skip


def cell_means(plane: np.ndarray) -> np.ndarray:
    """Return means over cells with row 0 at the bottom."""
    blocks = plane.reshape(NZ, SAMPLES_ACROSS, NX, SAMPLES_ACROSS, *plane.shape[2:])
    return blocks.mean(axis=(1, 3))[::-1]


def test_sums_are_means_of_linear_light(sampled) -> None:
    pixels, baseline = sampled
    sums = sums_of(pixels, baseline, np.ones(pixels.shape[:2], np.uint8))
    light = linear_light(pixels)
    np.testing.assert_allclose(sums.blocks.state, cell_means(light), rtol=1e-5)
    np.testing.assert_allclose(sums.blocks.baseline, cell_means(baseline), rtol=1e-5)
    np.testing.assert_allclose(sums.blocks.product, cell_means(light * baseline), rtol=1e-5)
    np.testing.assert_allclose(sums.share, 1.0, rtol=1e-5)


def test_the_ratio_is_that_of_corrected_light(sampled) -> None:
    pixels, baseline = sampled
    matrix = np.array([[1.1, -0.1, 0.0], [0.05, 0.9, 0.05], [0.0, -0.2, 1.2]])
    sums = sums_of(pixels, baseline, np.ones(pixels.shape[:2], np.uint8), matrix=matrix)
    corrected = [cell_means(light) @ matrix.T for light in (linear_light(pixels), baseline)]
    np.testing.assert_allclose(sums.log_ratio, log_ratio(*corrected), atol=1e-5)


def test_cells_without_samples_have_no_ratio(sampled) -> None:
    pixels, baseline = sampled
    sums = sums_of(pixels, baseline, np.zeros(pixels.shape[:2], np.uint8))
    assert (sums.log_ratio == 0).all()
    assert (sums.share == 0).all()


def test_glare_and_hidden_samples_do_not_count(sampled) -> None:
    pixels, baseline = sampled
    pixels[0, 0] = 255
    usable = np.ones(pixels.shape[:2], np.uint8)
    usable[1, 1] = 0
    share = sums_of(pixels, baseline, usable).share
    assert share[NZ - 1, 0] == pytest.approx(7 / 9)
    np.testing.assert_allclose(np.delete(share.ravel(), (NZ - 1) * NX), 1.0, rtol=1e-5)


def test_blocks_are_means_of_cells(sampled) -> None:
    pixels, baseline = sampled
    usable = np.ones(pixels.shape[:2], np.uint8)
    cells = sums_of(pixels, baseline, usable).blocks
    blocks = sums_of(pixels, baseline, usable, cells_across=2).blocks
    for own, means in zip(cells, blocks, strict=True):  # columns of 2, 2 and 1 cells
        assert means.shape[:2] == (2, 3)
        np.testing.assert_allclose(means[0, 0], own[:2, :2].mean(axis=(0, 1)), rtol=1e-5)
        np.testing.assert_allclose(means[1, 2], own[2:, 4:].mean(axis=(0, 1)), rtol=1e-5)


def test_a_front_across_a_cell_counts_by_its_logarithm() -> None:
    """Half stock and half water are half of the absorbance, although water outshines stock."""
    pixels = np.full((6, 6, 3), 200, np.uint8)
    pixels[:, 3:] = 80
    baseline = linear_light(np.full((6, 6, 3), 200, np.uint8))
    sums = cell_sums(
        pixels, baseline, np.ones((6, 6), np.uint8), light=LINEAR_LIGHT, matrix=np.eye(3),
        glare_level=250, samples_across=6,
    )  # fmt: skip
    dark = np.log(LINEAR_LIGHT[80] / LINEAR_LIGHT[200])
    np.testing.assert_allclose(sums.log_ratio, 0.5 * dark, rtol=1e-5)


def test_a_veil_of_light_is_taken_from_every_tile() -> None:
    generator = np.random.default_rng(6)
    pixels = generator.integers(60, 200, (12, 12, 3), dtype=np.uint8)
    tables = {'light': LINEAR_LIGHT, 'matrix': np.eye(3), 'glare_level': 250, 'samples_across': 6}
    usable = np.ones((12, 12), np.uint8)
    veil = np.array([0.02, 0.01, 0.005], np.float32)
    baseline = linear_light(pixels) - veil
    found = cell_sums(pixels, baseline, usable, **tables, veil=(0.02, 0.01, 0.005))
    np.testing.assert_allclose(found.log_ratio, 0.0, atol=1e-5)
    hazy = cell_sums(pixels, baseline, usable, **tables)
    assert hazy.log_ratio.min() > 0.01
    deep = cell_sums(pixels, baseline, usable, **tables, veil=(1.0, 1.0, 1.0))
    np.testing.assert_allclose(deep.log_ratio, np.log(0.02), atol=1e-5)
