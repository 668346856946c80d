"""Zones of the rig: polygons, and zones from pictures."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.polygons import inside

HALF = 0.5
"""A square of a picture lies in the zone if at least this share of it does."""


class Zone(Protocol):
    """A part of the rig. Points are (n, 2): x and z [m] from the lower left corner."""

    @property
    def outlines(self) -> tuple[FloatArray, ...]:
        """The closed edges for drawings, (m, 2) [m] each; a hole has an edge of its own."""
        ...

    def contains(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return whether `points` (n, 2) lie in the zone, (n,)."""
        ...

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the zone, (n,); 0 inside it."""
        ...

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the outside, (n,); 0 there.

        A polygon also ends along a side of the rig. A picture has no edge at a side.
        """
        ...


@dataclass(frozen=True)
class PolygonZone:
    """The inside of a polygon with `corners` (m, 2) [m], in either direction."""

    corners: FloatArray

    @property
    def outlines(self) -> tuple[FloatArray, ...]:
        """The polygon, closed."""
        return (np.vstack([self.corners, self.corners[:1]]),)

    def contains(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return whether `points` (n, 2) lie inside, (n,)."""
        return inside(points, self.corners)

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the filled polygon, (n,)."""
        return np.where(self.contains(points), 0.0, self._to_edge(points))

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the outside, (n,)."""
        return np.where(self.contains(points), self._to_edge(points), 0.0)

    def _to_edge(self, points: FloatArray) -> FloatArray:
        edge = np.roll(self.corners, -1, axis=0) - self.corners
        to_point = points[:, None, :] - self.corners[None]
        length2 = np.maximum((edge**2).sum(axis=1), np.finfo(float).tiny)
        along = np.clip((to_point * edge).sum(axis=2) / length2, 0.0, 1.0)
        across = to_point - along[..., None] * edge
        distance: FloatArray = np.linalg.norm(across, axis=2).min(axis=1)
        return distance


@dataclass(frozen=True, eq=False)
class PictureZone:
    """The zone that a picture of the whole rig shows.

    `shares` (nz, nx) [-] is the part of each square of `raster` in the zone.
    """

    shares: FloatArray
    raster: Grid

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """Which squares lie in the zone, (nz, nx)."""
        return np.asarray(self.shares >= HALF)

    @cached_property
    def outlines(self) -> tuple[FloatArray, ...]:
        """The lines where half of a square lies in the zone; those at the sides are closed."""
        raster = self.raster
        x = np.concatenate([[0.0], raster.x, [raster.width]])
        z = np.concatenate([[0.0], raster.z, [raster.height]])
        lines = contour_generator(x, z, np.pad(self.shares, 1)).lines(HALF)
        return tuple(np.asarray(line, dtype=float) for line in lines)

    def contains(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return whether the squares under `points` (n, 2) lie in the zone, (n,)."""
        return np.asarray(self.within[self._places(points)])

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the zone, (n,), to half a square."""
        return self._across(~self.within)[self._places(points)]

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance [m] of `points` (n, 2) to the outside, (n,), to half a square."""
        return self._across(self.within)[self._places(points)]

    def _across(self, part: NDArray[np.bool_]) -> FloatArray:
        """Return the distance [m] of the squares of `part` to its edge, 0 elsewhere, (nz, nx)."""
        if part.all():
            return np.full(part.shape, np.inf)
        from scipy.ndimage import distance_transform_edt  # takes a third of the start of a node

        squares = (self.raster.dz, self.raster.dx)
        return np.maximum(distance_transform_edt(part, squares) - 0.5 * max(squares), 0.0)

    def _places(self, points: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns of the squares under `points` (n, 2)."""
        raster = self.raster
        columns = np.clip(points[:, 0] / raster.dx, 0, raster.nx - 1).astype(np.intp)
        rows = np.clip(points[:, 1] / raster.dz, 0, raster.nz - 1).astype(np.intp)
        return rows, columns
