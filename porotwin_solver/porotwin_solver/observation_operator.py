"""What the camera makes of the concentration: the observation operators of the image effects."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_matrix

from porotwin_core.grid import FloatArray, Grid
from porotwin_solver.refinement import coarsen, coarsen_adjoint


@dataclass(frozen=True)
class ObservationOperator:
    """How the recorded map follows from the rig; the default shows the concentration itself.

    Moved first (`dx`, `dz` [m], `rotation` [rad], `scale` about the rig's middle), then bent
    (c ** `exponent`), then lit (1 + `drift` t + `gradient` (x - W/2), kept within 0..1). The map
    stamped t shows the rig at pump time t + `clock_offset` [s].
    """

    exponent: float = 1.0
    drift: float = 0.0
    gradient: float = 0.0
    dx: float = 0.0
    dz: float = 0.0
    rotation: float = 0.0
    scale: float = 1.0
    clock_offset: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether the picture is shifted, turned or scaled."""
        return (self.dx, self.dz, self.rotation, self.scale) != (0.0, 0.0, 0.0, 1.0)

    def shown(self, concentration: FloatArray, grid: Grid, time: float) -> FloatArray:
        """Return the map on `grid` that the camera makes at `time` [s] of a finer or equal map."""
        if self.moves:
            concentration = self._moved(concentration, grid)
        seen = coarsen(concentration, grid.shape)
        if self.exponent != 1.0:
            seen = np.maximum(seen, 0.0) ** self.exponent
        if self.drift or self.gradient:
            light = 1.0 + self.drift * time + self.gradient * (grid.x - grid.width / 2.0)
            seen = np.clip(seen * light, 0.0, 1.0)
        return seen

    def shown_adjoint(
        self, concentration: FloatArray, grid: Grid, time: float, bar: FloatArray
    ) -> FloatArray:
        """Return the derivative of a cost by `concentration` from `bar`, that by the shown map."""
        seen = coarsen(
            self._moved(concentration, grid) if self.moves else concentration, grid.shape
        )
        if self.drift or self.gradient:
            light = 1.0 + self.drift * time + self.gradient * (grid.x - grid.width / 2.0)
            lit = np.maximum(seen, 0.0) ** self.exponent * light
            bar = np.where((lit > 0.0) & (lit < 1.0), bar * light, 0.0)
        if self.exponent != 1.0:
            bar = bar * np.where(
                seen > 0.0, self.exponent * np.maximum(seen, 1e-12) ** (self.exponent - 1.0), 0.0
            )
        fine = coarsen_adjoint(bar, concentration.shape)
        if not self.moves:
            return fine
        back = _sampling(self, concentration.shape, grid).T @ fine.ravel()
        return np.asarray(back).reshape(fine.shape)

    def _moved(self, concentration: FloatArray, grid: Grid) -> FloatArray:
        """Return the moved map; from beyond the rig comes what lies at its edge."""
        moved = _sampling(self, concentration.shape, grid) @ concentration.ravel()
        return np.asarray(moved).reshape(concentration.shape)


@lru_cache(maxsize=8)
def _sampling(operator: ObservationOperator, shape: tuple[int, ...], grid: Grid) -> csr_matrix:
    """Return the bilinear weights with which a moved map (nz, nx) is read from the rig's."""
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
    left = np.minimum(np.floor(column).astype(int), max(nx - 2, 0))
    below = np.minimum(np.floor(row).astype(int), max(nz - 2, 0))
    right, above = np.minimum(left + 1, nx - 1), np.minimum(below + 1, nz - 1)
    part_x, part_z = column - left, row - below
    weights = [
        (1.0 - part_z) * (1.0 - part_x),
        (1.0 - part_z) * part_x,
        part_z * (1.0 - part_x),
        part_z * part_x,
    ]
    cells = [below * nx + left, below * nx + right, above * nx + left, above * nx + right]
    target = np.tile(np.arange(nz * nx), 4)
    return csr_matrix(
        (
            np.concatenate([w.ravel() for w in weights]),
            (target, np.concatenate([k.ravel() for k in cells])),
        ),
        shape=(nz * nx, nz * nx),
    )
