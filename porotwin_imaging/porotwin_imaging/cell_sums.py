"""Means of a photograph and its baseline over the cells of a map, in one pass over the samples."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


class BlockSums(NamedTuple):
    """Means over the samples of blocks of cells; samples that are not usable count as 0.

    A block holds enough samples to tell the scatter of light and the pattern of grains. All arrays
    have shape (rows, columns, 3 = red, green, blue), row 0 at the bottom, except `share`.

    Attributes:
        state: linear light of the photograph.
        baseline: linear light of the baseline.
        state_square: squared linear light of the photograph.
        baseline_square: squared linear light of the baseline.
        product: product of both.
        share: share of the samples that are usable in both pictures, shape (rows, columns).
    """

    state: Array
    baseline: Array
    state_square: Array
    baseline_square: Array
    product: Array
    share: Array


class CellSums(NamedTuple):
    """Means over the samples of each cell; samples that are not usable count as 0.

    Attributes:
        state: linear light of the photograph, shape (nz, nx, 3 = red, green, blue), row 0 at the
            bottom.
        baseline: linear light of the baseline, same shape.
        share: share of the samples that are usable in both pictures, shape (nz, nx).
        blocks: the same and the second moments over blocks of cells.
    """

    state: Array
    baseline: Array
    share: Array
    blocks: BlockSums


def cell_sums(
    pixels: NDArray[np.uint8],
    baseline: Array,
    usable: NDArray[np.uint8],
    *,
    light: Array,
    glare_level: int,
    samples_across: int,
    cells_across: int = 1,
) -> CellSums:
    """Return the means of a sampled photograph and baseline; both have row 0 at the top.

    Args:
        pixels: sampled photograph, uint8 blue-green-red, shape (rows, columns, 3).
        baseline: linear red-green-blue of the baseline, shape (rows, columns, 3).
        usable: 1 where the baseline shows sand, otherwise 0, shape (rows, columns).
        light: linear light of each grey level, shape (256,).
        glare_level: lowest grey level of over-exposed pixels.
        samples_across: samples of a cell in each direction.
        cells_across: cells of a block in each direction. Where the cells of the map are no multiple
            of it, the blocks differ by a cell.
    """
    state, before, share, *moments = _sums(
        pixels, baseline, usable, light, glare_level, samples_across, cells_across
    )
    if cells_across == 1:
        return CellSums(
            state,
            before,
            share,
            BlockSums(state, before, moments[2], moments[3], moments[4], share),
        )
    return CellSums(state, before, share, BlockSums(*moments))


@njit(cache=True, nogil=True, error_model='numpy')
def _sums(pixels, baseline, usable, light, glare_level, factor, cells_across):  # type: ignore[no-untyped-def]
    nz, nx = usable.shape[0] // factor, usable.shape[1] // factor
    high, wide = -(-nz // cells_across), -(-nx // cells_across)
    state = np.empty((nz, nx, 3), np.float32)
    before = np.empty((nz, nx, 3), np.float32)
    share = np.empty((nz, nx), np.float32)
    moments = np.zeros((5, high, wide, 3), np.float32)
    covered = np.zeros((high, wide), np.float32)
    cells = np.zeros((high, wide), np.float32)
    own = np.empty((5, 3), np.float32)
    part = np.float32(1.0 / (factor * factor))
    for k in range(nz):
        lowest = (nz - 1 - k) * factor
        row = k * high // nz
        for n in range(nx):
            column = n * wide // nx
            own[:] = 0.0
            count = 0
            for i in range(lowest, lowest + factor):
                for j in range(n * factor, (n + 1) * factor):
                    if usable[i, j] == 0:
                        continue
                    if max(pixels[i, j, 0], pixels[i, j, 1], pixels[i, j, 2]) >= glare_level:
                        continue
                    count += 1
                    for c in range(3):
                        now = light[pixels[i, j, 2 - c]]
                        then = baseline[i, j, c]
                        own[0, c] += now
                        own[1, c] += then
                        own[2, c] += now * now
                        own[3, c] += then * then
                        own[4, c] += now * then
            own *= part
            share[k, n] = count * part
            covered[row, column] += share[k, n]
            cells[row, column] += np.float32(1.0)
            for c in range(3):
                state[k, n, c] = own[0, c]
                before[k, n, c] = own[1, c]
                for moment in range(5):
                    moments[moment, row, column, c] += own[moment, c]
    for row in range(high):
        for column in range(wide):
            covered[row, column] /= cells[row, column]
            moments[:, row, column] /= cells[row, column]
    return (
        state, before, share,
        moments[0], moments[1], moments[2], moments[3], moments[4], covered,
    )  # fmt: skip
