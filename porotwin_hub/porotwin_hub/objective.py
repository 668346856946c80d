"""The cost of a tracer distribution: how much of it lies where it must not (paper, section 4)."""

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig


def distance_to_polygon(points: FloatArray, polygon: FloatArray) -> FloatArray:
    """Return the distance [m] of `points` (n, 2) to the filled `polygon` (m, 2); 0 inside it."""
    start, edge = polygon, np.roll(polygon, -1, axis=0) - polygon
    to_point = points[:, None, :] - start[None]
    length2 = np.maximum((edge**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip((to_point * edge).sum(axis=2) / length2, 0.0, 1.0)
    distance = np.linalg.norm(to_point - along[..., None] * edge, axis=2).min(axis=1)
    # even-odd rule: a ray to the right crosses the outline an odd number of times from inside
    below = to_point[..., 1] < 0
    crosses = below != np.roll(below, -1, axis=1)
    with np.errstate(divide='ignore', invalid='ignore'):
        right = to_point[..., 0] < edge[:, 0] * to_point[..., 1] / edge[:, 1]
    inside = (crosses & right).sum(axis=1) % 2 == 1
    return np.where(inside, 0.0, distance)


def fuzzy_mask(polygon: FloatArray, grid: Grid, fuzziness: float) -> FloatArray:
    """Return varphi (nz, nx): 1 in the disallowed zone, falling to 0 `fuzziness` [m] away.

    The fall is half a cosine, so that the cost is smooth in where the plume ends. It lets the twin
    respond before the plume reaches the zone, without looking far ahead (paper, section 4).
    """
    x, z = np.meshgrid(grid.x, grid.z)
    distance = distance_to_polygon(np.column_stack([x.ravel(), z.ravel()]), polygon)
    if fuzziness == 0:
        return (distance == 0).astype(float).reshape(grid.shape)
    share = np.clip(distance / fuzziness, 0.0, 1.0)
    return (0.5 * (1.0 + np.cos(np.pi * share))).reshape(grid.shape)


class Objective:
    """f(c) = integral of c varphi porosity depth dx [m^3], the tracer weighted by the fuzzy mask.

    The paper's integral of c varphi dx, weighted by the pore volume so that it is the volume of
    tracer stock in the zone, also where porosity or depth vary.
    """

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Prepare the weights of every cell.

        Raises:
            InputError: the rig has no control section.
        """
        if rig.control is None:
            raise InputError(f"rig '{rig.name}' has no control section; add one to rig.yaml")
        polygon = np.array(rig.control.disallowed_zone_m, dtype=float)
        pores = rig.field('porosity', grid) * rig.field('depth_m', grid) * grid.cell_area
        self.mask = fuzzy_mask(polygon, grid, rig.control.fuzziness_m)
        self._weights = self.mask * pores
        self._zone = fuzzy_mask(polygon, grid, 0.0) * pores

    def __call__(self, concentration: FloatArray) -> float:
        """Return f of a map (nz, nx) [m^3]; cells that were not seen (NaN) count as empty."""
        return float(np.nansum(concentration * self._weights))

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return the tracer within the zone's sharp outline [m^3]."""
        return float(np.nansum(concentration * self._zone))
