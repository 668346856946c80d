"""Means of a photograph and its baseline over the cells of a map, in one pass over the samples."""

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


class CellSums(NamedTuple):
    """Means over the samples of each cell; samples that are not usable count as 0.

    All arrays have shape (nz, nx, 3 = red, green, blue), row 0 at the bottom, except `share`.

    Attributes:
        state: linear light of the photograph.
        baseline: linear light of the baseline.
        state_square: squared linear light of the photograph.
        baseline_square: squared linear light of the baseline.
        product: product of both.
        share: share of the samples that are usable in both pictures, shape (nz, nx).
    """

    state: Array
    baseline: Array
    state_square: Array
    baseline_square: Array
    product: Array
    share: Array


def coarser(sums: CellSums, cells_across: int) -> CellSums:
    """Return the means over blocks of `cells_across` x `cells_across` cells.

    The last block of a row or column may be smaller.
    """
    if cells_across == 1:
        return sums
    nz, nx = sums.share.shape
    size = (math.ceil(nx / cells_across), math.ceil(nz / cells_across))
    return CellSums(*(cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in sums))


def cell_sums(
    pixels: NDArray[np.uint8],
    baseline: Array,
    usable: NDArray[np.uint8],
    *,
    light: Array,
    glare_level: int,
    samples_across: int,
) -> CellSums:
    """Return the means of a sampled photograph and baseline; both have row 0 at the top.

    Args:
        pixels: sampled photograph, uint8 blue-green-red, shape (rows, columns, 3).
        baseline: linear red-green-blue of the baseline, shape (rows, columns, 3).
        usable: 1 where the baseline shows sand, otherwise 0, shape (rows, columns).
        light: linear light of each grey level, shape (256,).
        glare_level: lowest grey level of over-exposed pixels.
        samples_across: samples of a cell in each direction.
    """
    return CellSums(*_sums(pixels, baseline, usable, light, glare_level, samples_across))


@njit(cache=True, nogil=True, error_model='numpy')
def _sums(pixels, baseline, usable, light, glare_level, factor):  # type: ignore[no-untyped-def]
    rows, columns = usable.shape
    nz, nx = rows // factor, columns // factor
    sums = np.zeros((5, nz, nx, 3), np.float32)
    share = np.zeros((nz, nx), np.float32)
    part = np.float32(1.0 / (factor * factor))
    for i in range(nz * factor):
        k = nz - 1 - i // factor
        for n in range(nx):
            for j in range(n * factor, (n + 1) * factor):
                if usable[i, j] == 0:
                    continue
                if max(pixels[i, j, 0], pixels[i, j, 1], pixels[i, j, 2]) >= glare_level:
                    continue
                share[k, n] += part
                for c in range(3):
                    now = light[pixels[i, j, 2 - c]]
                    then = baseline[i, j, c]
                    sums[0, k, n, c] += now
                    sums[1, k, n, c] += then
                    sums[2, k, n, c] += now * now
                    sums[3, k, n, c] += then * then
                    sums[4, k, n, c] += now * then
    sums *= part
    return sums[0], sums[1], sums[2], sums[3], sums[4], share
