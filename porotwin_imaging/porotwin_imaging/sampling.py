"""The sampling grid: which photograph pixels each cell of a map is read from.

A cell is sampled on `factor` x `factor` points, about one for each decoded pixel. A photograph is
read there in one remapping, moved by its alignment to the baseline; sums over a cell's samples
then take it to the map. Sampled pictures have their top row first, like photographs; maps have
the bottom row first, and the flip happens here.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import Grid
from porotwin_imaging.geometry import Geometry, apply_homography

Array = NDArray[Any]

FEWEST_PIXELS_PER_CELL = 1.4
"""Decoded pixels that a cell should span each way, where that saves half of the decoding."""
FEWEST_COLUMNS = 1200
"""Decoded width that alignment to the baseline should have, where the file has it [px]."""


def choose_reduction(geometry: Geometry, grid: Grid, photo_width: int) -> int:
    """Return the coarsest decoding (8, 4, 2, 1) that still resolves what the map needs."""
    per_cell = min(geometry.columns / grid.nx, geometry.rows / grid.nz)
    for reduction in (8, 4, 2):
        if (
            per_cell / reduction >= FEWEST_PIXELS_PER_CELL
            and photo_width / reduction >= FEWEST_COLUMNS
        ):
            return reduction
    # finest maps of large rigs: a little more than a pixel for each cell is enough
    return 2 if per_cell / 2 >= 1.2 and photo_width / 2 >= FEWEST_COLUMNS else 1


@dataclass(frozen=True)
class Sampling:
    """Sampling points of a map on `grid`: `columns`, `rows` in the baseline's decoded pixels."""

    grid: Grid
    factor: int
    columns: Array
    rows: Array

    @classmethod
    def of(cls, geometry: Geometry, grid: Grid, reduction: int) -> 'Sampling':
        """Return the sampling with about one point for each pixel decoded at `reduction`."""
        per_cell = max(geometry.columns / grid.nx, geometry.rows / grid.nz) / reduction
        factor = max(1, round(per_cell))
        fine = grid.refined(factor)
        x, z = np.meshgrid(fine.x, fine.z[::-1])
        columns, rows = geometry.to_pixels(x, z)
        decoded = [((c + 0.5) / reduction - 0.5).astype(np.float32) for c in (columns, rows)]
        return cls(grid, factor, decoded[0], decoded[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a sampled picture, (rows, columns)."""
        return self.columns.shape[0], self.columns.shape[1]

    def sample(self, pixels: Array, homography: Array | None = None) -> Array:
        """Return the picture `pixels` at the sampling points, moved by `homography`."""
        columns, rows = self.columns, self.rows
        if homography is not None:
            moved = apply_homography(homography.astype(np.float32), columns, rows)
            columns, rows = moved[0].astype(np.float32), moved[1].astype(np.float32)
        return cv2.remap(
            pixels, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )

    def cell_means(self, picture: Array) -> Array:
        """Return the mean of a sampled picture over each cell, shape (nz, nx[, channels])."""
        means = cv2.resize(picture, (self.grid.nx, self.grid.nz), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(means[::-1])
