"""What the camera makes of the concentration: the observation operators of the image effects."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from porotwin_core.grid import FloatArray, Grid
from porotwin_solver.refinement import coarsen, coarsen_adjoint


@dataclass(frozen=True)
class View:
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
        """Return the derivative by `concentration` of a cost with the derivative `bar` by `shown`.

        For views that move nothing.
        """
        seen = coarsen(concentration, grid.shape)
        if self.drift or self.gradient:
            light = 1.0 + self.drift * time + self.gradient * (grid.x - grid.width / 2.0)
            lit = np.maximum(seen, 0.0) ** self.exponent * light
            bar = np.where((lit > 0.0) & (lit < 1.0), bar * light, 0.0)
        if self.exponent != 1.0:
            bar = bar * np.where(
                seen > 0.0, self.exponent * np.maximum(seen, 1e-12) ** (self.exponent - 1.0), 0.0
            )
        return coarsen_adjoint(bar, concentration.shape)

    def _moved(self, concentration: FloatArray, grid: Grid) -> FloatArray:
        """Return the moved map; from beyond the rig comes what lies at its edge."""
        nz, nx = concentration.shape
        fine = Grid(nx, nz, grid.width, grid.height)
        centre_x, centre_z = grid.width / 2.0, grid.height / 2.0
        x = (fine.x[None, :] - centre_x - self.dx) / self.scale
        z = (fine.z[:, None] - centre_z - self.dz) / self.scale
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        from_x = cosine * x + sine * z + centre_x
        from_z = -sine * x + cosine * z + centre_z
        return map_coordinates(
            concentration,
            [from_z / fine.dz - 0.5, from_x / fine.dx - 0.5],
            order=1,
            mode='nearest',
        )
