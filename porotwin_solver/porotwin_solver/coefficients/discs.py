"""Distribution of a well's disc, at its true position, over the cells of a grid."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray, Grid

CellArray = NDArray[np.integer]
"""Flat indices of cells."""

LEAST_RADIUS = 0.5
"""Least radius [longer side of a cell] of a disc on a grid. The water of a smaller disc would enter
at the centre of its cell, wherever in the cell the well opens. Measured for six wells of 4 mm
radius: the error of maps on cells of 20 mm falls from 0.16-0.21 to 0.14-0.15."""


def _quadrant_overlap(x: FloatArray, z: FloatArray, radius: float) -> FloatArray:
    """Return the area of {0 <= s <= x, 0 <= t <= z} inside the disc about the origin (x, z >= 0).

    It is the area under min(z, sqrt(radius^2 - s^2)) from s = 0 to x, in closed form.
    """
    x, z = np.minimum(x, radius), np.minimum(z, radius)
    flat = np.minimum(x, np.sqrt(radius**2 - z**2))

    def under_arc(s: FloatArray) -> FloatArray:
        height = np.sqrt(np.maximum(radius**2 - s**2, 0.0))
        return 0.5 * (s * height + radius**2 * np.arcsin(np.clip(s / radius, -1.0, 1.0)))

    return flat * z + under_arc(x) - under_arc(flat)


@lru_cache
def disc_fractions(grid: Grid, x: float, z: float, radius: float) -> tuple[CellArray, FloatArray]:
    """Return the cells that the disc about (`x`, `z`) [m] overlaps, and the fraction in each.

    The fractions are exact areas of overlap divided by the area of the disc inside the rig. They
    add up to one. The cells are flat indices into a field (nz, nx). A disc smaller than a cell is
    widened to the width of a cell, so that a shift within the cell moves water to its neighbours.
    Both arrays are read-only, because later calls return them again.

    Raises:
        InputError: the centre lies outside the rig.
    """
    if not (0 <= x <= grid.width and 0 <= z <= grid.height):
        raise InputError(
            f'well at ({x:.6g}, {z:.6g}) m lies outside the rig of {grid.width} x {grid.height} m; '
            'correct its position'
        )
    radius = max(radius, LEAST_RADIUS * max(grid.dx, grid.dz))
    columns = _overlapped(x, radius, grid.dx, grid.nx)
    rows = _overlapped(z, radius, grid.dz, grid.nz)
    edges_x = np.append(columns, columns[-1] + 1) * grid.dx - x
    edges_z = np.append(rows, rows[-1] + 1) * grid.dz - z
    corner_x, corner_z = np.meshgrid(edges_x, edges_z)
    signed = (
        np.sign(corner_x)
        * np.sign(corner_z)
        * _quadrant_overlap(np.abs(corner_x), np.abs(corner_z), radius)
    )
    area = signed[1:, 1:] - signed[:-1, 1:] - signed[1:, :-1] + signed[:-1, :-1]
    cells = rows[:, None] * grid.nx + columns[None, :]
    overlapped = area > ROUND_OFF * radius**2
    found = cells[overlapped], area[overlapped] / area[overlapped].sum()
    for array in found:
        array.flags.writeable = False
    return found


def _overlapped(centre: float, radius: float, size: float, count: int) -> CellArray:
    low = max(int(np.floor((centre - radius) / size)), 0)
    high = min(int(np.floor((centre + radius) / size)), count - 1)
    return np.arange(low, high + 1)


def radial_front(volume: float, *, thickness: float) -> float:
    """Return the radius [m] of the front about a single injector in an unbounded rig.

    pi r^2 thickness = volume. `volume`: injected [m^3]; `thickness`: depth times porosity [m].
    """
    return math.sqrt(volume / (math.pi * thickness))
