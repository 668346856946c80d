"""Polygons in the plane: points inside, signed area, and outlines that cross themselves."""

import itertools

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray


def inside(points: FloatArray, polygon: FloatArray) -> NDArray[np.bool_]:
    """Return whether `points` (n, 2) lie inside `polygon` (m, 2), shape (n,), by the even-odd rule.

    A horizontal ray from a point inside crosses the outline an odd number of times.
    """
    x, z = points[:, 0], points[:, 1]
    odd = np.zeros(len(points), dtype=bool)
    for (x0, z0), (x1, z1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if z0 != z1:
            crosses = (z0 > z) != (z1 > z)
            odd ^= crosses & (x < x0 + (z - z0) * (x1 - x0) / (z1 - z0))
    return odd


def signed_area(polygon: FloatArray) -> float:
    """Return the area of `polygon` (m, 2), positive if its corners run from x towards z."""
    x, z = np.asarray(polygon, dtype=float).T
    return 0.5 * float(np.dot(x, np.roll(z, -1)) - np.dot(z, np.roll(x, -1)))


def crosses_itself(polygon: FloatArray) -> bool:
    """Return whether two sides of `polygon` (m, 2) that are not neighbours cross."""
    corners = np.asarray(polygon, dtype=float)
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    count = len(sides)
    return any(
        _cross(*sides[first], *sides[second])
        for first, second in itertools.combinations(range(count), 2)
        if second - first not in (1, count - 1)
    )


def _cross(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> bool:
    """Return whether the segments ab and cd cross at a point inside both."""
    return _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0


def _side(a: FloatArray, b: FloatArray, point: FloatArray) -> float:
    """Return twice the area of a triangle: positive to the left of the line from a to b."""
    return float((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]))
