"""Blocks of cells: their means show the place and the amount of a plume.

A block holds many cells, so noise of single cells counts little. A displaced front changes the
blocks that it crosses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid

BLOCK_M = 0.03
"""Side of a block [m]: some fronts thick, a third of the way between wells."""

MODEL_DEVIATION = 0.02
"""Error of the mean of a block that neither pumps nor known physics cause [-]."""

RELATED_BLOCKS = 4.0
"""Blocks whose errors are alike: they count as one observation."""

LEAST_SEEN = 0.5
"""Share of its cells that a block, or a whole map, must show to count."""


def error_variance(noise: FloatArray, *, alike: float = 1.0) -> FloatArray:
    """Return the variance of the differences between photograph and model, (blocks,).

    Args:
        noise: mean variance of the photograph in each block, (blocks,).
        alike: photographs that judge nearly the same course, this one included.
    """
    return RELATED_BLOCKS * alike * (noise + MODEL_DEVIATION**2)


@dataclass(frozen=True)
class Blocks:
    """Blocks of `rows` x `columns` cells each on a grid of shape `shape` (nz, nx)."""

    shape: tuple[int, int]
    rows: int
    columns: int

    @classmethod
    def of(cls, grid: Grid) -> 'Blocks':
        """Return blocks of about BLOCK_M on `grid`."""
        return cls(grid.shape, max(1, round(BLOCK_M / grid.dz)), max(1, round(BLOCK_M / grid.dx)))

    def sums(self, values: FloatArray) -> FloatArray:
        """Return the sum of `values` (..., nz, nx) over each block, (..., blocks)."""
        rows = np.arange(0, self.shape[0], self.rows)
        columns = np.arange(0, self.shape[1], self.columns)
        by_row = np.add.reduceat(values, rows, axis=-2)
        summed = np.add.reduceat(by_row, columns, axis=-1)
        return summed.reshape(*values.shape[:-2], -1)

    def means(self, values: FloatArray, seen: NDArray[np.bool_]) -> FloatArray:
        """Return the mean of `values` (..., nz, nx) over the `seen` cells of each block.

        The shape is (..., blocks); blocks that show too little are left out.
        """
        count = self.sums(seen.astype(float))
        size = self.sums(np.ones(self.shape))
        kept = count >= LEAST_SEEN * size
        total = self.sums(np.where(seen, np.nan_to_num(values), 0.0))
        return np.asarray(total[..., kept] / count[kept])
