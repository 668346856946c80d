"""Zones of an objective on a grid: distances to them, and masks that fade out (paper, sec. 4)."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.zone_shapes import PolygonZone, Zone
from porotwin_core.rig import Polygon, Rig


def zones_of(
    rig: Rig, polygons: Sequence[Polygon | None], grid: Grid, key: str
) -> tuple[Zone, ...]:
    """Return the zones with the corners `polygons` [m], or without any the one of `control.zone`.

    Args:
        rig: the rig; its description may name a file with the zone.
        polygons: corners as the objective has them; None: not given.
        grid: of the objective.
        key: of the corners in rig.yaml, for messages.

    Raises:
        InputError: there is no zone, or one covers no cell of `grid`.
    """
    zones: list[Zone] = [PolygonZone(np.array(one, dtype=float)) for one in polygons if one]
    if not zones and rig.zone is not None:
        zones, key = [rig.zone], 'control.zone'
    if not zones:
        raise InputError(
            f"'{key}' is missing: corners (x, z) of the zone [m]; a picture of it may stand in "
            'control.zone: {file: zone.png}'
        )
    for zone in zones:
        if not zone.contains(cell_centres(grid)).any():
            raise InputError(
                f'{key}: covers no cell of the rig of {grid.width} m x {grid.height} m; '
                'give its corners (x, z) in metres from the lower left corner'
            )
    return tuple(zones)


def distance_to_zones(zones: Sequence[Zone], grid: Grid) -> FloatArray:
    """Return the distance [m] of every cell (nz, nx) to the nearest of several `zones`."""
    centres = cell_centres(grid)
    distances = [zone.distance(centres) for zone in zones]
    return np.asarray(np.min(distances, axis=0).reshape(grid.shape))


def distance_to_outside(zone: Zone, grid: Grid) -> FloatArray:
    """Return the distance [m] of every cell (nz, nx) to the outside of `zone`; 0 there."""
    return zone.depth(cell_centres(grid)).reshape(grid.shape)


def distance_to_edge(zone: Zone, grid: Grid) -> tuple[FloatArray, FloatArray]:
    """Return the distance [m] of every cell to the edge of `zone`, and 1 inside it, 0 outside.

    The sides of the rig are no edge. Both are (nz, nx).
    """
    within = zone.contains(cell_centres(grid)).reshape(grid.shape)
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
