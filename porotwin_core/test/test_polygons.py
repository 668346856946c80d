"""Tests of polygons: places inside, areas with a sign, outlines that cross themselves."""

import numpy as np
import pytest

from porotwin_core.geometry.polygons import crosses_itself, inside, signed_area

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
BOW_TIE = SQUARE[[0, 2, 1, 3]]


def test_a_place_is_inside_a_polygon_with_a_dent_or_not() -> None:
    dented = np.array([[0, 0], [2, 0], [2, 2], [1, 1], [0, 2]], dtype=float)
    places = np.array([[1.0, 0.5], [1.0, 1.5], [0.2, 1.5], [3.0, 1.0]])
    assert inside(places, dented).tolist() == [True, False, True, False]


def test_the_sign_of_the_area_is_the_direction_of_the_corners() -> None:
    assert signed_area(SQUARE) == pytest.approx(1.0)
    assert signed_area(SQUARE[::-1]) == pytest.approx(-1.0)


@pytest.mark.parametrize(('polygon', 'crosses'), [(SQUARE, False), (BOW_TIE, True)])
def test_an_outline_that_crosses_itself_is_found(polygon: np.ndarray, crosses: bool) -> None:
    assert crosses_itself(polygon) is crosses
