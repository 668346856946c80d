"""Measures of the phases in a map: area, pores, outline, centre, and how much of it is in doubt."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.measures.plume_measures import SMALLEST_PART, contour_length
from porotwin_imaging.phases.phase_colours import UNKNOWN
from porotwin_imaging.phases.phase_segmentation import PhaseMap

Array = NDArray[Any]

SURE = 0.9
"""Cells with a smaller confidence are in doubt [-]."""
_OUTLINE_BLUR = 1.0
"""Blur of a map of cells before its outline is measured [cells]: steps of cells are no outline."""


@dataclass(frozen=True)
class PhaseMeasures:
    """Measures of one phase in one map; places are NaN where there is no such phase.

    Attributes:
        area_m2: area [m^2].
        doubt_m2: part of the area whose cells are less than 90 % sure [m^2].
        pores_ml: volume of the pores in this area [ml]. Gas fills only a part of them.
        contour_m: length of the outline [m]; the edge of the rig does not count.
        x_m, z_m: centre of the area [m].
        parts: separate parts of the area.
    """

    area_m2: float
    doubt_m2: float
    pores_ml: float
    contour_m: float
    x_m: float
    z_m: float
    parts: int


def phase_measures(found: PhaseMap, phase: int, grid: Grid, pore_volume: Array) -> PhaseMeasures:
    """Return the measures of a phase.

    Args:
        found: the phases in one photograph.
        phase: number of the phase.
        grid: the grid of the map.
        pore_volume: volume of the pores of each cell [m^3], shape (nz, nx).
    """
    cells = found.phase == phase
    count = int(cells.sum())
    doubtful = int((cells & (found.confidence < SURE)).sum())
    x, z = cells.sum(axis=0) @ grid.x, cells.sum(axis=1) @ grid.z
    numbered, _ = label(cells, np.ones((3, 3)))
    sizes = np.bincount(numbered.ravel())[1:]
    return PhaseMeasures(
        area_m2=count * grid.cell_area,
        doubt_m2=doubtful * grid.cell_area,
        pores_ml=float(pore_volume[cells].sum() * 1e6),
        contour_m=_outline(found.phase, phase, grid),
        x_m=float(x / count) if count else np.nan,
        z_m=float(z / count) if count else np.nan,
        parts=int((sizes >= SMALLEST_PART).sum()),
    )


def _outline(numbers: NDArray[np.uint8], phase: int, grid: Grid) -> float:
    """Return the length of the outline of a phase [m]; unknown cells have none."""
    known = (numbers != UNKNOWN).astype(np.float32)
    cells = (numbers == phase).astype(np.float32)
    share = _blurred(cells) / np.maximum(_blurred(known), SMALLEST_DIVISOR)
    return contour_length(np.where(known > 0, share, np.nan), grid, 0.5)


def _blurred(plane: Array) -> Array:
    """Return a plane without the steps of its cells."""
    return cv2.GaussianBlur(plane, (0, 0), _OUTLINE_BLUR, borderType=cv2.BORDER_REPLICATE)
