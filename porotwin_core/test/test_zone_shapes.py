"""Zones as shapes: polygons and pictures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.zone_shapes import PictureZone, PolygonZone

SQUARE = PolygonZone(np.array([[0.2, 0.2], [0.6, 0.2], [0.6, 0.6], [0.2, 0.6]]))
L_SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.4, 0.3], [0.4, 1.0], [0.0, 1.0]])


def picture(zone: PolygonZone, squares: int = 100) -> PictureZone:
    """Return the picture of a zone of a rig of 1 m x 1 m."""
    raster = Grid(squares, squares, 1.0, 1.0)
    x, z = np.meshgrid(raster.x, raster.z)
    points = np.column_stack([x.ravel(), z.ravel()])
    return PictureZone(zone.contains(points).astype(float).reshape(raster.shape), raster)


def test_distances_to_a_square_are_known() -> None:
    points = np.array([[0.4, 0.4], [0.4, 0.7], [0.7, 0.7], [0.2, 0.3], [0.0, 0.4]])
    expected = [0.0, 0.1, np.hypot(0.1, 0.1), 0.0, 0.2]
    np.testing.assert_allclose(SQUARE.distance(points), expected, atol=1e-12)


def test_distances_to_the_outside_of_a_square_are_known() -> None:
    points = np.array([[0.4, 0.4], [0.4, 0.7], [0.3, 0.25], [0.5, 0.59]])
    np.testing.assert_allclose(SQUARE.depth(points), [0.2, 0.0, 0.05, 0.01], atol=1e-12)


def test_a_notch_of_a_concave_zone_is_outside() -> None:
    assert PolygonZone(L_SHAPE).distance(np.array([[0.7, 0.7]])) == pytest.approx(0.3)


@given(x=st.floats(-1, 2), z=st.floats(-1, 2), shift=st.integers(0, 3))
def test_the_outline_may_start_at_any_corner(x: float, z: float, shift: int) -> None:
    point, rolled = np.array([[x, z]]), PolygonZone(np.roll(L_SHAPE, shift, axis=0))
    expected = PolygonZone(L_SHAPE).distance(point)
    np.testing.assert_allclose(rolled.distance(point), expected, atol=1e-12)


def test_a_picture_of_a_polygon_is_the_polygon_to_a_square() -> None:
    points = np.random.default_rng(3).uniform(0.0, 1.0, (400, 2))
    drawn = picture(SQUARE)
    assert (drawn.contains(points) != SQUARE.contains(points)).mean() < 0.02
    np.testing.assert_allclose(drawn.distance(points), SQUARE.distance(points), atol=0.012)
    np.testing.assert_allclose(drawn.depth(points), SQUARE.depth(points), atol=0.012)


def test_the_outline_of_a_picture_encloses_its_zone_also_at_the_sides_of_the_rig() -> None:
    shares = np.zeros((10, 10))
    shares[6:] = 1.0
    (outline,) = PictureZone(shares, Grid(10, 10, 1.0, 1.0)).outlines
    np.testing.assert_allclose(outline[0], outline[-1])
    np.testing.assert_allclose([outline.min(axis=0), outline.max(axis=0)], [[0, 0.6], [1, 1]],
                               atol=0.03)  # fmt: skip


def test_a_hole_has_an_outline_of_its_own() -> None:
    shares = np.ones((9, 9))
    shares[4, 4] = 0.0
    zone = PictureZone(shares, Grid(9, 9, 0.9, 0.9))
    assert len(zone.outlines) == 2
    assert not zone.contains(np.array([[0.45, 0.45]]))[0]
