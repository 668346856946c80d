"""Maps as pictures: the right way up, honest colours, holes where nothing was seen."""

import cv2
import numpy as np
import pytest
from page_examples import GRID, after, observation, two_cycles

from porotwin_page import snapshot
from porotwin_page.pictures import (
    DIFFERENCE_LIMITS,
    colour_table,
    difference_limit,
    paint,
    picture,
    scale,
)
from porotwin_page.snapshot import Snapshot

TABLE = colour_table('concentration', 'light')


def decoded(data: bytes | None) -> np.ndarray:
    assert data is not None
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def lightness(table: np.ndarray) -> np.ndarray:
    """Return CIE L* of colours (n, 4) blue-green-red-alpha."""
    bgr = table[None, :, :3].astype(np.float32) / 255
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2LAB)[0, :, 0]


def test_the_bottom_row_of_a_field_is_the_last_row_of_its_picture() -> None:
    values = np.zeros((3, 4))
    values[0, 1] = 1.0
    pixels = paint(values, 0.0, 1.0, TABLE)
    np.testing.assert_array_equal(pixels[2, 1], TABLE[255])
    np.testing.assert_array_equal(pixels[0, 1], TABLE[0])


def test_what_was_not_seen_is_transparent_and_what_is_outside_takes_the_end_colour() -> None:
    pixels = paint(np.array([[np.nan, -3.0, 7.0]]), 0.0, 1.0, TABLE)
    assert pixels[0, 0, 3] == 0
    np.testing.assert_array_equal(pixels[0, 1:], TABLE[[0, 255]])


@pytest.mark.parametrize(('theme', 'sign'), [('light', -1), ('dark', 1)])
def test_lightness_of_concentration_is_monotonic_and_even(theme, sign) -> None:
    steps = sign * np.diff(lightness(colour_table('concentration', theme))[::16])
    assert (steps > 0).all()
    assert steps.max() < 3 * steps.min()


@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_differences_of_either_sign_are_equally_far_from_none(theme) -> None:
    shade = lightness(colour_table('difference', theme))
    # published maps of 256 colours are symmetric to a few of 100 levels
    np.testing.assert_allclose(shade[:128], shade[:127:-1], atol=12)
    assert abs(shade[127] - shade[0]) > 40


def test_the_scale_of_differences_is_one_of_few_and_shows_nearly_all() -> None:
    values = np.linspace(-0.09, 0.09, 1001)[None]
    assert difference_limit(values) == 0.1
    values[0, 500] = 1.0
    assert difference_limit(values) == 0.1
    front = np.zeros((100, 100))
    front[50] = 0.4
    assert difference_limit(front) == 0.5
    assert difference_limit(np.full((2, 2), np.nan)) == DIFFERENCE_LIMITS[0]
    assert difference_limit(np.full((2, 2), 5.0)) == DIFFERENCE_LIMITS[-1]


@pytest.mark.parametrize('theme', ['light', 'dark'])
@pytest.mark.parametrize('kind', ['observed', 'forecast', 'difference'])
def test_every_map_has_a_pixel_for_every_cell(kind, theme) -> None:
    assert decoded(picture(two_cycles(), kind, theme)).shape == (*GRID.shape, 4)
    assert decoded(scale(kind, theme)).shape == (1, 256, 4)


@pytest.mark.parametrize('kind', ['observed', 'forecast', 'difference'])
def test_a_map_that_is_not_there_has_no_picture(kind) -> None:
    assert picture(Snapshot(), kind, 'light') is None


def test_the_picture_shows_the_observed_map() -> None:
    seen = observation(1, value=0.0)
    seen.map.concentration[-1, 0] = 1.0
    pixels = decoded(picture(after((snapshot.with_observation, seen)), 'observed', 'light'))
    np.testing.assert_array_equal(pixels[0, 0], TABLE[255])
    assert (pixels.reshape(-1, 4)[1:] == TABLE[0]).all()
