"""Zones of the rig: distances to a polygon, and masks that fade out around it (paper, sec. 4)."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.polygons import inside
from porotwin_core.rig import Polygon


def distance_to_outline(points: FloatArray, polygon: FloatArray) -> FloatArray:
    """Return the distance [m] of `points` (n, 2) to the edges of `polygon` (m, 2), shape (n,)."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    to_point = points[:, None, :] - polygon[None]
    length2 = np.maximum((edge**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip((to_point * edge).sum(axis=2) / length2, 0.0, 1.0)
    distance: FloatArray = np.linalg.norm(to_point - along[..., None] * edge, axis=2).min(axis=1)
    return distance


def distance_to_zone(points: FloatArray, polygon: FloatArray) -> FloatArray:
    """Return the distance [m] of `points` (n, 2) to the filled `polygon` (m, 2); 0 inside it."""
    return np.where(inside(points, polygon), 0.0, distance_to_outline(points, polygon))


def distance_to_outside(points: FloatArray, polygon: FloatArray) -> FloatArray:
    """Return the distance [m] of `points` (n, 2) to the outside of `polygon` (m, 2); 0 there."""
    return np.where(inside(points, polygon), distance_to_outline(points, polygon), 0.0)


def checked_zone(corners: Polygon, grid: Grid, key: str) -> FloatArray:
    """Return the polygon (m, 2) [m] of a zone with `corners`.

    Raises:
        InputError: no cell of `grid` lies in the zone; the message names the `key` of rig.yaml.
    """
    polygon = np.array(corners, dtype=float)
    if not inside(cell_centres(grid), polygon).any():
        raise InputError(
            f'{key}: covers no cell of the rig of {grid.width} m x {grid.height} m; '
            'give its corners (x, z) in metres from the lower left corner'
        )
    return polygon


def distance_to_zones(zones: Sequence[Polygon], grid: Grid, key: str) -> FloatArray:
    """Return the distance [m] of every cell (nz, nx) to the nearest of several `zones`.

    Raises:
        InputError: a zone covers no cell of `grid`; the message names the `key` of rig.yaml.
    """
    centres = cell_centres(grid)
    distances = [distance_to_zone(centres, checked_zone(zone, grid, key)) for zone in zones]
    return np.asarray(np.min(distances, axis=0).reshape(grid.shape))


def distance_to_edge(zone: Polygon, grid: Grid, key: str) -> tuple[FloatArray, FloatArray]:
    """Return the distance [m] of every cell to the edge of `zone`, and 1 inside it, 0 outside.

    The sides of the rig are no edge. Both are (nz, nx).

    Raises:
        InputError: the zone covers no cell of `grid`; the message names the `key` of rig.yaml.
    """
    within = inside(cell_centres(grid), checked_zone(zone, grid, key)).reshape(grid.shape)
    cells = (grid.dz, grid.dx)
    if within.all():
        return np.full(grid.shape, np.inf), within.astype(float)
    across = distance_transform_edt(within, cells) + distance_transform_edt(~within, cells)
    return np.maximum(across - 0.5 * max(cells), 0.0), within.astype(float)


def fuzzy_mask(distance: FloatArray, fuzziness: float) -> FloatArray:
    """Return varphi: 1 at distance 0, falling to 0 at the distance `fuzziness` [m].

    varphi = (1 + cos(pi d / fuzziness)) / 2 for a distance d < fuzziness. The cost is then smooth
    in the position of the plume's front, and the twin responds before the plume reaches the zone
    without looking far ahead (paper, section 4). A fuzziness of 0 gives the sharp zone.
    """
    if fuzziness == 0:
        return (distance == 0).astype(float)
    share = np.clip(distance / fuzziness, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(np.pi * share))


def cell_centres(grid: Grid) -> FloatArray:
    """Return the centres (x, z) [m] of all cells of `grid`, shape (nz * nx, 2), row by row."""
    x, z = np.meshgrid(grid.x, grid.z)
    return np.column_stack([x.ravel(), z.ravel()])
