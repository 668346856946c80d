"""Means of a photograph and its baseline over the cells of a map, in one pass over the samples.

A front of tracer may cross a cell. The mean of the light is then no measure of the mean tracer,
because the bright part outshines the dark one: half stock and half water look like a quarter of
stock. The mean of the logarithm is a measure. Single samples are noisy and feel every small blur,
so the log ratio is taken over tiles of 2 x 2 or 3 x 3 samples, and averaged over the tiles of a
cell. A cell whose samples cannot be divided like this is one tile.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]

LEAST_LIGHT = np.float32(1e-5)
"""Linear light is raised to this before it divides, and before a logarithm."""
LEAST_BELOW_VEIL = np.float32(0.02)
"""Light below a veil is raised to this, relative to the baseline: less is noise of the camera."""
_TILES = (3, 2)
"""Samples across a tile in the order of preference: enough to average grains, finer than fronts."""


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
    """Sums over the samples of each cell, and over blocks of cells.

    Attributes:
        log_ratio: mean over the tiles of a cell of the log of the corrected light of the photograph
            over that of the baseline, shape (nz, nx, 3 = red, green, blue), row 0 at the bottom; 0
            without usable samples.
        share: share of the samples that are usable in both pictures, shape (nz, nx).
        blocks: light and its second moments over blocks of cells.
    """

    log_ratio: Array
    share: Array
    blocks: BlockSums


def cell_sums(
    pixels: NDArray[np.uint8],
    baseline: Array,
    usable: NDArray[np.uint8],
    *,
    light: Array,
    matrix: Array,
    glare_level: int,
    samples_across: int,
    cells_across: int = 1,
    veil: tuple[float, float, float] | None = None,
) -> CellSums:
    """Return the sums of a sampled photograph and baseline; both have row 0 at the top.

    The ratio of the sums over a tile weights every grain by its own light. The colour matrix acts
    on the sums, which equals its action on every sample because it is linear.

    Args:
        pixels: sampled photograph, uint8 blue-green-red, shape (rows, columns, 3).
        baseline: linear red-green-blue of the baseline, shape (rows, columns, 3).
        usable: 1 where the baseline shows sand, otherwise 0, shape (rows, columns).
        light: linear light of each grey level, shape (256,).
        matrix: from colours of the camera to colours of the chart, shape (3, 3).
        glare_level: lowest grey level of over-exposed pixels.
        samples_across: samples of a cell in each direction.
        cells_across: cells of a block in each direction. Where the cells of the map are no multiple
            of it, the blocks differ by a cell.
        veil: linear red-green-blue of haze over the photograph. `log_ratio` is without it: it is
            taken from every tile, because it brightens dark grains most.
    """
    log_ratio, share, moments, covered = _sums(
        pixels,
        baseline,
        usable,
        light,
        np.ascontiguousarray(matrix, np.float32),
        glare_level,
        samples_across,
        tile_of(samples_across),
        cells_across,
        np.asarray(veil or (0.0, 0.0, 0.0), np.float32),
    )
    state, before, state_square, before_square, product = moments
    return CellSums(
        log_ratio,
        share,
        BlockSums(state, before, state_square, before_square, product, covered),
    )


def tile_of(samples_across: int) -> int:
    """Return the samples across a tile of a cell of `samples_across` samples."""
    return next((size for size in _TILES if samples_across % size == 0), samples_across)


@njit(cache=True, nogil=True, error_model='numpy')
def _sums(pixels, baseline, usable, light, matrix, glare_level, factor, tile, cells_across, veil):  # type: ignore[no-untyped-def]
    nz, nx = usable.shape[0] // factor, usable.shape[1] // factor
    high, wide = -(-nz // cells_across), -(-nx // cells_across)
    log_ratio = np.empty((nz, nx, 3), np.float32)
    veiled = veil[0] != 0.0 or veil[1] != 0.0 or veil[2] != 0.0
    share = np.empty((nz, nx), np.float32)
    moments = np.zeros((5, high, wide, 3), np.float32)
    covered = np.zeros((high, wide), np.float32)
    cells = np.zeros((high, wide), np.float32)
    columns = np.arange(nx) * wide // nx
    own = np.empty((5, 3), np.float32)
    light_sums = np.empty((2, 3), np.float32)
    logs = np.empty(3, np.float32)
    part = np.float32(1.0 / (factor * factor))
    for k in range(nz):
        lowest = (nz - 1 - k) * factor
        row = k * high // nz
        for n in range(nx):
            own[:] = 0.0
            logs[:] = 0.0
            count = 0
            for first in range(lowest, lowest + factor, tile):
                for left in range(n * factor, (n + 1) * factor, tile):
                    light_sums[:] = 0.0
                    seen = 0
                    for i in range(first, first + tile):
                        for j in range(left, left + tile):
                            brightest = max(pixels[i, j, 0], pixels[i, j, 1], pixels[i, j, 2])
                            if usable[i, j] == 0 or brightest >= glare_level:
                                continue
                            seen += 1
                            for c in range(3):
                                now = light[pixels[i, j, 2 - c]]
                                then = baseline[i, j, c]
                                light_sums[0, c] += now
                                light_sums[1, c] += then
                                own[2, c] += now * now
                                own[3, c] += then * then
                                own[4, c] += now * then
                    if seen == 0:
                        continue
                    count += seen
                    for c in range(3):
                        now, then = np.float32(0.0), np.float32(0.0)
                        for e in range(3):
                            now += matrix[c, e] * light_sums[0, e]
                            then += matrix[c, e] * light_sums[1, e]
                        least = LEAST_LIGHT * seen
                        if veiled:
                            for e in range(3):
                                now -= matrix[c, e] * veil[e] * seen
                            now = max(now, LEAST_BELOW_VEIL * then)
                        logs[c] += seen * np.log(max(now, least) / max(then, least))
                        own[0, c] += light_sums[0, c]
                        own[1, c] += light_sums[1, c]
            own *= part
            column = columns[n]
            share[k, n] = count * part
            covered[row, column] += share[k, n]
            cells[row, column] += np.float32(1.0)
            for c in range(3):
                log_ratio[k, n, c] = logs[c] / max(count, 1)
                for moment in range(5):
                    moments[moment, row, column, c] += own[moment, c]
    covered /= cells
    for row in range(high):
        for column in range(wide):
            moments[:, row, column] /= cells[row, column]
    return log_ratio, share, moments, covered
