"""Sampling points: which pixels of a photograph belong to each cell of a map.

A cell is sampled on `samples_across` x `samples_across` points, about one per decoded pixel. A
photograph is read at these points in one remapping, moved by its alignment to the baseline; then
the samples of each cell are summed. Sampled pictures have row 0 at the top, like photographs. Maps
have row 0 at the bottom. The rows are flipped here and in `cell_sums.py`.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.geometry.corners_and_lens import Geometry, apply_homography
from porotwin_imaging.numerics.row_bands import by_bands, row_bands


@dataclass(frozen=True)
class SamplingSettings:
    """How finely a photograph is decoded and sampled (`sampling.py`)."""

    least_pixels_per_cell: float = 1.2
    """Decoded pixels per cell in each direction that a coarser decoding must leave [px]."""
    judged_columns: int = 400
    """Cells across the rig on which light, noise and sands are judged; finer ones only add noise
    and time."""
    least_columns: int = 1200
    """Width [px] below which alignment to the baseline becomes inaccurate."""


SAMPLING = SamplingSettings()


Array = NDArray[Any]


_FEWEST_FOR_BLOCKS = 4
"""Samples of a cell in each direction from which they are even, so that they divide into blocks."""


def choose_reduction(
    geometry: Geometry,
    grid: Grid,
    photo_width: int,
) -> int:
    """Return the coarsest decoding (8, 4, 2 or 1) that resolves the cells of `grid`.

    `photo_width`: columns of the file [px].
    """
    pixels_per_cell = min(geometry.columns / grid.nx, geometry.rows / grid.nz)
    for reduction in (8, 4, 2):
        if (
            pixels_per_cell / reduction >= SAMPLING.least_pixels_per_cell
            and photo_width / reduction >= SAMPLING.least_columns
        ):
            return reduction
    return 1


def samples_across(geometry: Geometry, grid: Grid, reduction: int) -> int:
    """Return the samples of a cell in each direction, about one per pixel after decoding."""
    pixels_per_cell = max(geometry.columns / grid.nx, geometry.rows / grid.nz) / reduction
    across = max(1, round(pixels_per_cell))
    return across if across < _FEWEST_FOR_BLOCKS else 2 * round(pixels_per_cell / 2)


@dataclass(frozen=True)
class Sampling:
    """Sampling points of a map.

    Attributes:
        grid: the grid of the map.
        samples_across: samples of a cell in each direction.
        columns: columns of the points in the decoded baseline [px], float32, shape
            (nz * samples_across, nx * samples_across), row 0 at the top.
        rows: their rows, same shape.
    """

    grid: Grid
    samples_across: int
    columns: Array
    rows: Array

    @classmethod
    def of(cls, geometry: Geometry, grid: Grid, reduction: int) -> 'Sampling':
        """Return the sampling with about one point per pixel decoded at `reduction`."""
        across = samples_across(geometry, grid, reduction)
        fine = grid.refined(across)

        def band(z: Array) -> tuple[Array, ...]:
            pixels = geometry.to_pixels(*np.meshgrid(fine.x, z[:, 0]))
            return tuple(((c + 0.5) / reduction - 0.5).astype(np.float32) for c in pixels)

        columns, rows = by_bands(band, np.broadcast_to(fine.z[::-1, None], fine.shape))
        return cls(grid, across, columns, rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (rows, columns) of a sampled picture."""
        return self.columns.shape[0], self.columns.shape[1]

    @property
    def pixels_per_cell(self) -> tuple[float, float]:
        """Mean height and width of a cell [decoded px], along the middle of the rig."""
        rows, columns = (size // 2 for size in self.shape)
        middle = (
            (self.columns[:, columns], self.rows[:, columns]),
            (self.columns[rows], self.rows[rows]),
        )
        up, across = (float(np.hypot(x[-1] - x[0], y[-1] - y[0])) / (x.size - 1) for x, y in middle)
        return up * self.samples_across, across * self.samples_across

    def sample(self, pixels: Array, homography: Array | None = None) -> Array:
        """Return the decoded picture `pixels` at the sampling points.

        `homography` (3, 3) moves the points from the baseline to the photograph.
        """
        sampled = np.empty((*self.shape, *pixels.shape[2:]), pixels.dtype)
        for band in row_bands(self.shape):
            columns, rows = self.columns[band], self.rows[band]
            if homography is not None:
                columns, rows = apply_homography(homography.astype(np.float32), columns, rows)
            cv2.remap(
                pixels, columns, rows, cv2.INTER_LINEAR, dst=sampled[band],
                borderMode=cv2.BORDER_CONSTANT, borderValue=0,
            )  # fmt: skip
        return sampled

    def cell_means(self, picture: Array) -> Array:
        """Return the mean of a sampled picture over each cell, (nz, nx) or (nz, nx, channels)."""
        means = cv2.resize(picture, (self.grid.nx, self.grid.nz), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(means[::-1])
