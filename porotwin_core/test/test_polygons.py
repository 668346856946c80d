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


def test_places_inside_do_not_depend_on_their_order() -> None:
    generator = np.random.default_rng(4)
    angles = np.sort(generator.uniform(0.0, 2.0 * np.pi, 200))
    radii = generator.uniform(0.5, 1.0, 200)
    star = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    places = generator.uniform(-1.0, 1.0, (500, 2))
    wanted = [bool(inside(place[None], star)[0]) for place in places]
    assert inside(places, star).tolist() == wanted
    nearest = np.hypot(*places.T) < 0.3  # no side comes as near to the centre
    assert inside(places, star)[nearest & (np.hypot(*places.T) > 0.0)].all()
    assert not crosses_itself(star)
    star[[20, 120]] = star[[120, 20]]
    assert crosses_itself(star)


def test_a_point_on_a_common_side_lies_in_one_of_both_polygons() -> None:
    on_side = np.array([[1.0, 0.25], [1.0, 0.5]])
    assert (inside(on_side, SQUARE) ^ inside(on_side, SQUARE + np.array([1.0, 0.0]))).all()
