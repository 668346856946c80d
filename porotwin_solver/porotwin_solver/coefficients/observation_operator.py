"""The observation operator: from the concentration in the rig to the camera's map."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_matrix

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_solver.coefficients.refinement import coarsen, coarsen_adjoint

SAMPLINGS_KEPT = 8
"""Interpolation matrices kept, 100 B per cell each: one per camera effect under study."""


@dataclass(frozen=True)
class ObservationOperator:
    """The map that the camera records of a concentration; the default is the identity.

    The operator acts in this order:

    1. registration: a point p appears at C + scale R(rotation) (p - C) + (dx, dz), C the middle of
       the rig; `dx`, `dz` [m], `rotation` [rad], `scale` [-];
    2. saturation: c ** `exponent` [-];
    3. illumination: c (1 + `level` + `drift` t + `gradient` (x - W/2)), clipped to 0..1; `level`
       [-], `drift` [1/s], `gradient` [1/m], W the width of the rig.

    The map with the stamp t shows the rig at pump time t + `clock_offset` [s].
    """

    exponent: float = 1.0
    level: float = 0.0
    drift: float = 0.0
    gradient: float = 0.0
    dx: float = 0.0
    dz: float = 0.0
    rotation: float = 0.0
    scale: float = 1.0
    clock_offset: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether the picture is shifted, rotated or scaled."""
        return (self.dx, self.dz, self.rotation, self.scale) != (0.0, 0.0, 0.0, 1.0)

    @property
    def _relights(self) -> bool:
        return bool(self.level or self.drift or self.gradient)

    def apply(self, concentration: FloatArray, grid: Grid, time: float) -> FloatArray:
        """Return the map on `grid`, (nz, nx), that the camera records at `time` [s].

        `concentration` lies on `grid` or on a finer grid of whole multiples of its cells.
        """
        seen = self._moved_and_averaged(concentration, grid)
        if self.exponent != 1.0:
            seen = np.maximum(seen, 0.0) ** self.exponent
        if self._relights:
            seen = np.clip(seen * self._light(grid, time), 0.0, 1.0)
        return seen

    def apply_adjoint(
        self, concentration: FloatArray, grid: Grid, time: float, bar: FloatArray
    ) -> FloatArray:
        """Return dJ/dconcentration, in its shape, from `bar` = dJ/dmap (nz, nx)."""
        seen = self._moved_and_averaged(concentration, grid)
        if self._relights:
            light = self._light(grid, time)
            lit = np.maximum(seen, 0.0) ** self.exponent * light
            bar = np.where((lit > 0.0) & (lit < 1.0), bar * light, 0.0)
        if self.exponent != 1.0:
            power = np.maximum(seen, SMALLEST_DIVISOR) ** (self.exponent - 1.0)
            bar = bar * np.where(seen > 0.0, self.exponent * power, 0.0)
        fine = coarsen_adjoint(bar, concentration.shape)
        if not self.moves:
            return fine
        back = _sampling(self, concentration.shape, grid).T @ fine.ravel()
        return np.asarray(back).reshape(fine.shape)

    def _light(self, grid: Grid, time: float) -> FloatArray:
        """Return the factor of the illumination in every column, (nx,)."""
        return 1.0 + self.level + self.drift * time + self.gradient * (grid.x - grid.width / 2.0)

    def _moved_and_averaged(self, concentration: FloatArray, grid: Grid) -> FloatArray:
        """Return the registered map on `grid`; beyond the rig the values of its edge continue."""
        if self.moves:
            moved = _sampling(self, concentration.shape, grid) @ concentration.ravel()
            concentration = np.asarray(moved).reshape(concentration.shape)
        return coarsen(concentration, grid.shape)


@lru_cache(maxsize=SAMPLINGS_KEPT)
def _sampling(operator: ObservationOperator, shape: tuple[int, ...], grid: Grid) -> csr_matrix:
    """Return the bilinear weights from a flat map of `shape` (nz, nx) to the moved map."""
    nz, nx = shape
    centre_x, centre_z = grid.width / 2.0, grid.height / 2.0
    x = ((np.arange(nx)[None, :] + 0.5) * grid.width / nx - centre_x - operator.dx) / operator.scale
    z = (
        (np.arange(nz)[:, None] + 0.5) * grid.height / nz - centre_z - operator.dz
    ) / operator.scale
    cosine, sine = math.cos(operator.rotation), math.sin(operator.rotation)
    column = (cosine * x + sine * z + centre_x) / grid.width * nx - 0.5
    row = (-sine * x + cosine * z + centre_z) / grid.height * nz - 0.5
    column, row = np.clip(column, 0.0, nx - 1.0), np.clip(row, 0.0, nz - 1.0)
    left_column = np.minimum(np.floor(column).astype(int), max(nx - 2, 0))
    row_below = np.minimum(np.floor(row).astype(int), max(nz - 2, 0))
    right_column = np.minimum(left_column + 1, nx - 1)
    row_above = np.minimum(row_below + 1, nz - 1)
    part_x, part_z = column - left_column, row - row_below
    weights = [
        (1.0 - part_z) * (1.0 - part_x),
        (1.0 - part_z) * part_x,
        part_z * (1.0 - part_x),
        part_z * part_x,
    ]
    cells = [
        row_below * nx + left_column,
        row_below * nx + right_column,
        row_above * nx + left_column,
        row_above * nx + right_column,
    ]
    target = np.tile(np.arange(nz * nx), 4)
    return csr_matrix(
        (
            np.concatenate([w.ravel() for w in weights]),
            (target, np.concatenate([k.ravel() for k in cells])),
        ),
        shape=(nz * nx, nz * nx),
    )
