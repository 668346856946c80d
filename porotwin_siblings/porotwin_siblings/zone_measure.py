"""The tracer and the plume's area in the zone where no tracer must be."""

from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rig import Rig
from porotwin_core.rig.control_zones import unwanted_tracer
from porotwin_solver.coefficients.refinement import coarsen, refine
from porotwin_solver.effects import tracer_storage

SAMPLES = 4
"""Samples along each side of a cell that tell its share in the zone."""

REACHED_SHARE = 1e-3
"""Share of the zone's pore volume that must be tracer before the zone counts as reached."""


@dataclass(frozen=True)
class ZoneMeasure:
    """Measures of a map in the zone.

    `pores` are the pore volumes of the cells within the zone [m^3], (nz, nx); `area` is the area
    within the zone of each quarter of a cell [m^2], (2 nz, 2 nx). Without a zone all are NaN, and
    so are the measures.
    """

    pores: FloatArray
    area: FloatArray

    @classmethod
    def of(cls, rig: Rig, grid: Grid) -> 'ZoneMeasure':
        """Return the measures in the zones of the objective; NaN where it has none."""
        fine = grid.refined(SAMPLES)
        sample = _in_zone(rig, fine)
        half = grid.refined(2)
        return cls(
            pores=coarsen(sample, grid.shape) * tracer_storage(rig, grid),
            area=coarsen(sample, half.shape) * half.cell_area,
        )

    def tracer(self, concentration: FloatArray) -> float:
        """Return the tracer stock in the zone [m^3] of a map (nz, nx)."""
        return float(np.sum(concentration * self.pores))

    def plume_area(self, concentration: FloatArray) -> float:
        """Return the area of the zone [m^2] where a map (nz, nx) exceeds PLUME_THRESHOLD.

        Cells are split into quarters first, so that the area changes smoothly.
        """
        if not self.known:
            return np.nan
        covered = refine(concentration, self.area.shape) > PLUME_THRESHOLD
        return float(self.area[covered].sum())

    @property
    def known(self) -> bool:
        """Whether the objective has a zone where no tracer must be."""
        return bool(np.isfinite(self.pores).all())

    @property
    def reached_tracer(self) -> float:
        """Tracer that must be in the zone before it counts as reached [m^3]."""
        return REACHED_SHARE * float(self.pores.sum())


def _in_zone(rig: Rig, grid: Grid) -> np.ndarray:
    """Return 1 for each cell whose middle lies where no tracer must be, (nz, nx); NaN: no zone."""
    middles = np.column_stack([axis.ravel() for axis in np.meshgrid(grid.x, grid.z)])
    within = unwanted_tracer(rig, middles)
    if within is None:
        return np.full(grid.shape, np.nan)
    return within.astype(float).reshape(grid.shape)
