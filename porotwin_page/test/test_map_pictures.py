"""Tests of maps as pictures: orientation, colours, and holes in unseen cells."""

import cv2
import numpy as np
import pytest

from porotwin_page.map_pictures import (
    DIFFERENCE_LIMITS,
    colour_table,
    difference_limit,
    paint,
    png,
    scale,
)

TABLE = colour_table('concentration', 'light')


def decoded(data: bytes) -> np.ndarray:
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


def test_unseen_cells_are_transparent_and_values_outside_have_the_colour_of_the_limit() -> None:
    pixels = paint(np.array([[np.nan, -3.0, 7.0]]), 0.0, 1.0, TABLE)
    assert pixels[0, 0, 3] == 0
    np.testing.assert_array_equal(pixels[0, 1:], TABLE[[0, 255]])


@pytest.mark.parametrize(('theme', 'sign'), [('light', -1), ('dark', 1)])
def test_lightness_of_concentration_is_monotonic_and_even(theme, sign) -> None:
    steps = sign * np.diff(lightness(colour_table('concentration', theme))[::16])
    assert (steps > 0).all()
    assert steps.max() < 3 * steps.min()


@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_differences_of_both_signs_have_equal_contrast(theme) -> None:
    shade = lightness(colour_table('difference', theme))
    # published maps of 256 colours are symmetric to a few of 100 levels
    np.testing.assert_allclose(shade[:128], shade[:127:-1], atol=12)
    assert abs(shade[127] - shade[0]) > 40


def test_the_limit_of_differences_is_one_of_few_and_covers_nearly_all() -> None:
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
@pytest.mark.parametrize('quantity', ['concentration', 'difference'])
def test_a_picture_keeps_every_pixel(quantity, theme) -> None:
    table = colour_table(quantity, theme)
    pixels = paint(np.random.default_rng(3).random((7, 12)), 0.0, 1.0, table)
    np.testing.assert_array_equal(decoded(png(pixels)), pixels)
    np.testing.assert_array_equal(decoded(scale(quantity, theme)), table[None])
