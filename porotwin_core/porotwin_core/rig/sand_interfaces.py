"""Which permeabilities are one sand, and where sands meet."""

from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig.description import Rig

CELLS = (240, 160)
"""Cells (columns, rows) on which interfaces are looked for: finer than a picture shows."""

SAME_SAND = 0.02
"""Relative difference of the permeabilities of one sand [-]: the resolution of a map file."""

MOST_SANDS, LEVELS_OF_A_MAP = 12, 6
"""Most permeabilities that count as sands; more are a map of values, drawn by a few levels."""


class Interfaces(NamedTuple):
    """Contours that are the interfaces.

    grid: where the logarithm is known.
    logarithm: ln of the permeability in m^2, (nz, nx).
    levels: the values of the contours, ascending.
    """

    grid: Grid
    logarithm: FloatArray
    levels: FloatArray


def sand_level(permeability: float | FloatArray) -> FloatArray:
    """Return the ln of a permeability [m^2], 2-D, which is the same number within one sand."""
    positive = np.maximum(np.atleast_2d(permeability), np.finfo(float).tiny)
    return np.asarray(SAME_SAND * np.round(np.log(positive) / SAME_SAND))


def interfaces(rig: Rig) -> Interfaces | None:
    """Return the interfaces between the sands of `rig`; None if the whole rig is of one sand."""
    grid = rig.grid(*CELLS)
    logarithm = np.log(rig.field('permeability_m2', grid))
    known = np.unique(sand_level(rig.nominal_map('permeability_m2')))
    if len(known) > MOST_SANDS:
        return Interfaces(
            grid, logarithm, np.linspace(known[0], known[-1], LEVELS_OF_A_MAP + 2)[1:-1]
        )
    apart = np.diff(known) > 1.5 * SAME_SAND  # values on both sides of a rounding are one sand
    levels = ((known[1:] + known[:-1]) / 2.0)[apart]
    return Interfaces(grid, logarithm, levels) if levels.size else None
