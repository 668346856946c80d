"""Tests of zones: distances to polygons, and the fuzzy mask."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.grid import FloatArray, Grid
from porotwin_hub.zones import cell_centres, distance_to_outside, distance_to_zone, fuzzy_mask

L_SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.4, 0.3], [0.4, 1.0], [0.0, 1.0]])


def test_distances_to_a_square_are_known(square: FloatArray) -> None:
    points = np.array([[0.4, 0.4], [0.4, 0.7], [0.7, 0.7], [0.2, 0.3], [0.0, 0.4]])
    expected = [0.0, 0.1, np.hypot(0.1, 0.1), 0.0, 0.2]
    np.testing.assert_allclose(distance_to_zone(points, square), expected, atol=1e-12)


def test_distances_to_the_outside_of_a_square_are_known(square: FloatArray) -> None:
    points = np.array([[0.4, 0.4], [0.4, 0.7], [0.3, 0.25], [0.5, 0.59]])
    expected = [0.2, 0.0, 0.05, 0.01]
    np.testing.assert_allclose(distance_to_outside(points, square), expected, atol=1e-12)


def test_a_notch_of_a_concave_zone_is_outside() -> None:
    assert distance_to_zone(np.array([[0.7, 0.7]]), L_SHAPE) == pytest.approx(0.3)


@given(x=st.floats(-1, 2), z=st.floats(-1, 2), shift=st.integers(0, 3))
def test_the_outline_may_start_at_any_corner(x: float, z: float, shift: int) -> None:
    point = np.array([[x, z]])
    rolled = np.roll(L_SHAPE, shift, axis=0)
    np.testing.assert_allclose(
        distance_to_zone(point, rolled), distance_to_zone(point, L_SHAPE), atol=1e-12
    )


def test_the_mask_falls_from_one_to_zero_over_the_fuzziness(square: FloatArray) -> None:
    grid = Grid(100, 100, 1.0, 1.0)
    distance = distance_to_zone(cell_centres(grid), square).reshape(grid.shape)
    mask = fuzzy_mask(distance, 0.1)
    assert mask.min() == 0.0
    assert mask.max() == 1.0
    row = mask[40]
    assert (row[20:60] == 1.0).all()
    assert row[65] == pytest.approx(0.5, abs=0.1)
    assert (row[71:] == 0.0).all()
    assert (np.diff(row[59:71]) < 0).all()


def test_without_fuzziness_the_mask_is_the_zone(square: FloatArray) -> None:
    grid = Grid(50, 50, 1.0, 1.0)
    mask = fuzzy_mask(distance_to_zone(cell_centres(grid), square), 0.0)
    assert set(np.unique(mask)) == {0.0, 1.0}
    assert mask.mean() == pytest.approx(0.16)
