"""Plumes from known places in maps of a relative scale: their tips and centre lines.

Both need no scale: a plume is the connected part of a map above half of its core that begins near
a well. The tip is its place farthest from the well. The centre line is the middle of the plume over
every column.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig import Rig

Array = NDArray[Any]

FRONT = 0.5
"""Share of the core at the outline of a plume [-]."""
_NEAR_M = 0.03
"""A plume begins within this distance of its well [m]."""
_HOLE_PX = 5
"""Holes of a map are filled this many cells deep."""


@dataclass(frozen=True)
class PlumeLine:
    """A plume from one well.

    Attributes:
        cells: its cells, shape (nz, nx).
        tip, tail: the places (x, z) [m] farthest from the well, and nearest to it.
        x, z: the centre line [m], from left to right.
        arrived: whether it touches open water, where it leaves the sand: it has no tip then.
    """

    cells: Array
    tip: tuple[float, float]
    tail: tuple[float, float]
    x: Array
    z: Array
    arrived: bool


def plume_lines(
    values: Array, rig: Rig, grid: Grid, expected: Mapping[str, Array] | None = None
) -> dict[str, PlumeLine]:
    """Return the plumes of a relative map (nz, nx) by the well where they begin.

    Cells without a value are filled from those around them. Open water holds no plume. Where wells
    have stopped, plumes are told by the cells (nz, nx) where each is `expected`.
    """
    water = open_water(rig, grid)
    filled = np.where(water, 0.0, without_holes(values))
    parts, _ = label(filled > FRONT)
    x, z = np.meshgrid(grid.x, grid.z)
    found = {}
    for name, well in rig.wells.items():
        distance = np.hypot(x - well.x_m, z - well.z_m)
        place = distance < _NEAR_M if expected is None else expected.get(name, parts < 0)
        near = parts[place & (parts > 0)]
        if near.size:
            cells = parts == np.bincount(near).argmax()
            found[name] = line_of(np.where(cells, filled, 0.0), distance, grid, water)
    return found


def line_of(values: Array, distance: Array, grid: Grid, water: NDArray[np.bool_]) -> PlumeLine:
    """Return the line of a plume.

    Args:
        values: relative map that shows this plume alone, shape (nz, nx).
        distance: distance of each cell from the well [m], same shape.
        grid: grid of the map.
        water: cells of open water, which hold no plume, same shape.
    """
    values = np.where(water, 0.0, values)
    cells = values > FRONT
    shore = cv2.dilate(water.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    ends = np.where(cells, distance, -1.0).argmax(), np.where(cells, distance, np.inf).argmin()
    tip, tail = (_place(int(end), grid) for end in ends)
    weight = np.where(cells, values, 0.0)
    total = weight.sum(axis=0)
    seen = total > 0
    middle = (weight * grid.z[:, None]).sum(axis=0)[seen] / total[seen]
    return PlumeLine(
        cells,
        tip,
        tail,
        grid.x[seen],
        middle,
        bool((cells & shore).any()),
    )


def _place(cell: int, grid: Grid) -> tuple[float, float]:
    """Return the middle (x, z) [m] of a cell by its number in the flat map."""
    row, column = divmod(cell, grid.nx)
    return float(grid.x[column]), float(grid.z[row])


@dataclass(frozen=True)
class LineDistance:
    """A predicted plume beside the seen one [m].

    Attributes:
        tip: distance of the tips; NaN if both plumes have arrived at open water.
        ahead: by how much the predicted tip is farther from the well; negative: nearer.
        line: mean distance of the centre lines over the columns that both have.
        above: by how much the predicted centre line is higher on average.
        tail: distance of the ends nearest to the well; NaN if one is still at the well.
    """

    tip: float
    ahead: float
    line: float
    above: float
    tail: float


def line_error(predicted: PlumeLine, seen: PlumeLine, well: tuple[float, float]) -> LineDistance:
    """Return the errors of a predicted plume from the `well` at (x, z) [m]."""
    tips = np.array([predicted.tip, seen.tip])
    far = np.linalg.norm(tips - np.array(well), axis=1)
    first = max(predicted.x[0], seen.x[0])
    last = min(predicted.x[-1], seen.x[-1])
    columns = seen.x[(seen.x >= first) & (seen.x <= last)]
    apart = np.interp(columns, predicted.x, predicted.z) - np.interp(columns, seen.x, seen.z)
    if not columns.size:
        apart = np.array([np.nan])
    both_arrived = predicted.arrived and seen.arrived
    tip, ahead = float(np.linalg.norm(tips[0] - tips[1])), float(far[0] - far[1])
    return LineDistance(
        np.nan if both_arrived else tip,
        np.nan if both_arrived else ahead,
        float(np.abs(apart).mean()),
        float(apart.mean()),
        _tail_error(predicted, seen, well),
    )


def _tail_error(predicted: PlumeLine, seen: PlumeLine, well: tuple[float, float]) -> float:
    """Return the distance of two tails [m] that have left their `well`; NaN if one has not."""
    tails = np.array([predicted.tail, seen.tail])
    left = np.linalg.norm(tails - np.array(well), axis=1) > _NEAR_M
    return float(np.linalg.norm(tails[0] - tails[1])) if left.all() else np.nan


def without_holes(values: Array) -> Array:
    """Return a relative map (nz, nx) with small holes filled from their sides; wide ones are 0."""
    levels = np.rint(255 * np.clip(np.nan_to_num(values), 0.0, 1.0)).astype(np.uint8)
    holes = np.isnan(values).astype(np.uint8)
    filled = cv2.inpaint(levels, holes, _HOLE_PX, cv2.INPAINT_TELEA) / 255.0
    return np.where(cv2.distanceTransform(holes, cv2.DIST_L2, 5) > _HOLE_PX, 0.0, filled)


def open_water(rig: Rig, grid: Grid) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) in open water, and one cell around it."""
    x, z = np.meshgrid(grid.x, grid.z)
    places = np.stack([x.ravel(), z.ravel()], axis=1)
    wet = np.zeros(grid.shape, bool)
    for body in rig.water.values():
        if body.corners_m is not None:
            wet |= inside(places, np.array(body.corners_m)).reshape(grid.shape)
    return cv2.dilate(wet.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
