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

LEAST_SEEN = 0.5
"""Share of its cells that a block must show to count."""


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
