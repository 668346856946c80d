"""Work band by band gives the same as work on the whole map."""

import numpy as np

from porotwin_imaging.numerics.row_bands import CELLS_PER_BAND, by_bands, by_overlapping_bands


def test_bands_change_no_bit() -> None:
    generator = np.random.default_rng(41)
    nz, nx = 9, CELLS_PER_BAND // 4  # four rows to a band, and one left over
    light = generator.random((nz, nx, 3)).astype(np.float32)
    weight = generator.random((nz, nx))

    def work(light: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.log(light) * weight[..., None], weight > 0.5

    for found, whole in zip(by_bands(work, light, weight), work(light, weight), strict=True):
        assert found.dtype == whole.dtype
        np.testing.assert_array_equal(found, whole)


def test_a_small_map_is_one_band() -> None:
    calls = []

    def work(field: np.ndarray) -> tuple[np.ndarray]:
        calls.append(field.shape)
        return (2 * field,)

    by_bands(work, np.ones((150, 200)))
    assert calls == [(150, 200)]


def test_overlapping_bands_change_no_bit() -> None:
    generator = np.random.default_rng(43)
    values = generator.random((75, CELLS_PER_BAND // 20)).astype(np.float32)

    def work(values: np.ndarray) -> tuple[np.ndarray]:
        padded = np.pad(values, ((2, 2), (0, 0)), mode='edge')
        return (padded[:-4] + padded[4:] * padded[2:-2],)

    (found,), (whole,) = by_overlapping_bands(work, 2, values), work(values)
    np.testing.assert_array_equal(found, whole)
