"""The cells near wells, and near all places where tracer may leave."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig, Well

NEAR_CELLS = 2.5
"""Distance from a well, or from an open side, that is near [cells]."""


def cells_near(wells: Iterable[Well], grid: Grid) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of `grid` that lie near one of `wells`."""
    near = np.zeros(grid.shape, dtype=bool)
    for well in wells:
        away = np.hypot(grid.x[None, :] - well.x_m, grid.z[:, None] - well.z_m)
        near |= away < well.radius_m + NEAR_CELLS * max(grid.dx, grid.dz)
    return near


def ways_out(rig: Rig, rates: Schedule, grid: Grid) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) near wells that produce, beside sides with water, in canals."""
    producers = {row.well for row in rates.rows if row.rate.rate < 0.0}
    exits = cells_near([rig.wells[name] for name in producers], grid)
    beside = math.ceil(NEAR_CELLS)
    edges = {
        'bottom': exits[:beside],
        'top': exits[-beside:],
        'left': exits[:, :beside],
        'right': exits[:, -beside:],
    }
    for body in rig.water_bodies.values():
        if body.side is not None:
            edges[body.side][:] = True
        else:
            x, z = np.meshgrid(grid.x, grid.z)
            places, corners = np.column_stack([x.ravel(), z.ravel()]), np.array(body.corners_m)
            exits |= inside(places, corners).reshape(grid.shape)
    return exits
