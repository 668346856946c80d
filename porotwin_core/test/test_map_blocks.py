"""Tests of the means over blocks of cells."""

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.map_blocks import Blocks

GRID = Grid(10, 5, 0.10, 0.05)


def test_blocks_are_means_of_the_seen_cells() -> None:
    blocks = Blocks.of(GRID)
    assert (blocks.rows, blocks.columns) == (3, 3)
    values = np.arange(50.0).reshape(5, 10)
    seen = np.ones(values.shape, dtype=bool)
    means = blocks.means(values, seen)
    assert len(means) == 8
    assert means[0] == values[:3, :3].mean()
    seen[0, 0] = False
    values[0, 0] = np.nan
    assert blocks.means(values, seen)[0] == np.nanmean(values[:3, :3])


def test_a_block_that_shows_too_little_is_left_out() -> None:
    blocks = Blocks.of(GRID)
    seen = np.ones(GRID.shape, dtype=bool)
    seen[:3, :3] = False
    assert blocks.means(np.zeros((2, *GRID.shape)), seen).shape == (2, 7)
