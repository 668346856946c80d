"""What a photograph and its baseline give over each cell of a map, in one pass over the samples."""

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


class CellSums(NamedTuple):
    """Means over the samples of each cell, (nz, nx, 3 = red, green, blue), row 0 the bottom.

    `state`, `baseline`: linear light of the photograph and of the baseline; `state_square`,
    `baseline_square`, `product`: of their squares and product; `share` (nz, nx): of the cell's
    samples that are usable in both. A sample that is not counts as 0 in all means.
    """

    state: Array
    baseline: Array
    state_square: Array
    baseline_square: Array
    product: Array
    share: Array


def coarser(sums: CellSums, blocks: int) -> CellSums:
    """Return the means over blocks of `blocks` x `blocks` cells; the last ones may be smaller."""
    if blocks == 1:
        return sums
    nz, nx = sums.share.shape
    size = (math.ceil(nx / blocks), math.ceil(nz / blocks))
    return CellSums(*(cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in sums))


def cell_sums(
    pixels: NDArray[np.uint8],
    baseline: Array,
    usable: NDArray[np.uint8],
    *,
    light: Array,
    glare_level: int,
    factor: int,
) -> CellSums:
    """Return the sums of a sampled photograph and baseline, both with the top row first.

    `pixels` (rows, columns, 3) uint8 blue, green, red; `baseline` (rows, columns, 3) linear red,
    green, blue; `usable` (rows, columns) 0 or 1; `light` (256,): linear light of a grey level;
    `glare_level`: grey level from which a pixel is over-exposed; `factor` samples each way a cell.
    """
    return CellSums(*_sums(pixels, baseline, usable, light, glare_level, factor))


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
