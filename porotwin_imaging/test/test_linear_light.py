"""Linear light of grey levels."""

import numpy as np
import pytest

from porotwin_imaging.photograph.linear_light import LINEAR_LIGHT, linear_light, linear_light_near


def test_linear_light_is_the_inverse_of_the_srgb_curve() -> None:
    light = LINEAR_LIGHT.astype(float)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(255 * curve, np.arange(256), atol=1e-3)


def test_channels_are_red_green_blue() -> None:
    pixels = np.array([[[0, 0, 255]]], np.uint8)  # OpenCV stores blue first
    assert linear_light(pixels)[0, 0].tolist() == [1.0, 0.0, 0.0]


def test_only_the_surroundings_are_converted() -> None:
    pixels = np.full((100, 200, 3), 255, np.uint8)
    light = linear_light_near(pixels, np.array([[50.0, 40], [50, 50], [60, 50], [60, 40]]))
    assert light[45, 55, 0] == pytest.approx(1.0)
    assert light[45, 150, 0] == 0.0
