"""The tracer and the plume's area in the zone where no tracer must be."""

from dataclasses import dataclass

import numpy as np

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.polygons import inside
from porotwin_core.rig import Rig
from porotwin_solver.quantities import PLUME_THRESHOLD
from porotwin_solver.refinement import coarsen, refine

SAMPLES = 4
"""Samples along each side of a cell that tell its share in the zone."""

REACHED_SHARE = 1e-3
"""Share of the zone's pore volume that must be tracer before the zone counts as reached."""


@dataclass(frozen=True)
class ZoneMeasure:
    """Measures of a map in the zone.

    `pores` are the pore volumes of the cells within the zone [m^3], (nz, nx); `area` is the area
    within the zone of each quarter of a cell [m^2], (2 nz, 2 nx).
    """

    pores: FloatArray
    area: FloatArray

    @classmethod
    def of(cls, rig: Rig, grid: Grid) -> 'ZoneMeasure':
        """Return the measures in the zone of the control section; of a rig without one, nothing."""
        fine = grid.refined(SAMPLES)
        sample = _in_zone(rig, fine).astype(float)
        half = grid.refined(2)
        return cls(
            pores=coarsen(sample, grid.shape) * rig.cell_pore_volume(grid),
            area=coarsen(sample, half.shape) * half.cell_area,
        )

    def tracer(self, concentration: FloatArray) -> float:
        """Return the tracer stock in the zone [m^3] of a map (nz, nx)."""
        return float(np.sum(concentration * self.pores))

    def plume_area(self, concentration: FloatArray) -> float:
        """Return the area of the zone [m^2] where a map (nz, nx) exceeds PLUME_THRESHOLD.

        Cells are split into quarters first, so that the area changes smoothly.
        """
        covered = refine(concentration, self.area.shape) > PLUME_THRESHOLD
        return float(self.area[covered].sum())

    @property
    def reached_tracer(self) -> float:
        """Tracer in the zone from which on it counts as reached [m^3]."""
        return REACHED_SHARE * float(self.pores.sum())


def _in_zone(rig: Rig, grid: Grid) -> np.ndarray:
    """Return whether the middle of each cell lies where no tracer must be, (nz, nx)."""
    if rig.control is None:
        return np.zeros(grid.shape, dtype=bool)
    middles = np.column_stack([axis.ravel() for axis in np.meshgrid(grid.x, grid.z)])
    corners = rig.control.disallowed_zone_m
    kept_in = rig.control.objective.parameters.get('zone_m')
    if corners:
        within = inside(middles, np.array(corners, dtype=float))
    elif kept_in is not None:
        within = ~inside(middles, np.array(kept_in, dtype=float))
    else:
        within = np.zeros(len(middles), dtype=bool)
    return within.reshape(grid.shape)
