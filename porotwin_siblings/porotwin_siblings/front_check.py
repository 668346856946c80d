"""How far the plume's front was from its forecast, anywhere in the rig.

A cause that no sibling knows, such as a swinging water table, moves the front wherever it is. So it
shows before the plume reaches the zone, and the zone alone tells nothing then. Recent forecasts
missed the front by some distance. What is more than usual moves the expected front out and in, and
the tracer and the area in the zone then widen the bands.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_dilation, grey_erosion

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.effect_parameter import HALF_INTERVAL
from porotwin_siblings.forecast_check import CHECK_S, FadingSquare

USUAL_MISS_M = 1e-3
"""Miss of a front that the other widening covers [m]."""

MEMORY = 0.8
"""Weight of earlier photographs beside the newest one: a new cause must show within minutes."""

USUAL_WEIGHT = 2.0
"""Photographs that the usual miss is worth."""

LEAST_SLOPE = 1.0
"""Slope of the concentration that belongs to a front [1/m]: noise has none over some cells."""

MOST_CELLS = 6
"""Greatest distance of a moved front in cells of the siblings: beyond, any forecast is a guess."""


def front_miss(expected: FloatArray, seen: FloatArray, grid: Grid) -> float:
    """Return how far the front that is `seen` lies from the `expected` one [m].

    The difference of the maps (nz, nx) is taken for a growth of the plume on all sides and a shift
    of it, by least squares. NaN where no front is seen.
    """
    along = np.asarray(np.gradient(expected, grid.dz, grid.dx))
    slope = np.linalg.norm(along, axis=0)
    front = (slope > LEAST_SLOPE) & np.isfinite(seen)
    if front.sum() < 10:
        return math.nan
    columns = np.column_stack([slope[front], along[0][front], along[1][front]])
    moved = np.linalg.lstsq(columns, (seen - expected)[front], rcond=None)[0]
    return float(np.linalg.norm(moved))


class FrontCheck:
    """Follows the misses of the front, in forecasts that are CHECK_S old."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._misses = FadingSquare(USUAL_MISS_M, USUAL_WEIGHT, MEMORY)

    def compare(self, miss: float) -> None:
        """Take how far a front was from its forecast [m]; NaN: there was none."""
        if math.isfinite(miss):
            self._misses.add(miss**2)

    @property
    def excess(self) -> float:
        """The miss beyond the usual one [m]."""
        return math.sqrt(max(self._misses.mean - USUAL_MISS_M**2, 0.0))

    def distances(self, times: FloatArray) -> FloatArray:
        """Return how far the front may be from its forecast [m], 90 % of the time, (times,).

        It grows with the root of the time ahead [s]: an unknown cause goes on, but not always in
        one direction.
        """
        return HALF_INTERVAL * self.excess * np.sqrt((times / CHECK_S).clip(1.0))


def widened(
    band: FloatArray,
    maps: FloatArray,
    distances: FloatArray,
    grid: Grid,
    measure: Callable[[FloatArray], float],
) -> FloatArray:
    """Return a band with the doubt about the front added to both sides.

    Args:
        band: low end, median and high end of a quantity in the zone, (3, times).
        maps: expected maps, (times, nz, nx).
        distances: of the front from its forecast [m], (times,).
        grid: of the maps.
        measure: returns the quantity of a map (nz, nx).
    """
    result = band.copy()
    for place, (map_, distance) in enumerate(zip(maps, distances, strict=True)):
        cells = min(float(distance) / min(grid.dx, grid.dz), float(MOST_CELLS))
        if cells <= 0.0:
            continue
        reach = math.ceil(cells)
        disk = _disk(reach)
        share, usual = cells / reach, measure(map_)
        less = share * (usual - measure(grey_erosion(map_, footprint=disk)))
        more = share * (measure(grey_dilation(map_, footprint=disk)) - usual)
        low, median, high = band[:, place]
        result[0, place] = max(median - math.hypot(median - low, less), 0.0)
        result[2, place] = median + math.hypot(high - median, more)
    return result


def _disk(radius: int) -> NDArray[np.bool_]:
    """Return the cells within `radius` cells, (2 radius + 1, 2 radius + 1)."""
    offsets = np.arange(-radius, radius + 1)
    return np.asarray(np.hypot(offsets[:, None], offsets[None, :]) <= radius + 0.5)
