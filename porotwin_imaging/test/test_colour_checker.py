"""The Classic chart: its published colours, its place and the gain of light."""

import colour
import numpy as np
import pytest

from porotwin_imaging.light import colour_checker
from porotwin_imaging.light.colour_checker import REFERENCE

CORNERS = np.array([[60.0, 25.0], [60, 120], [205, 120], [205, 25]])


@pytest.fixture
def picture(laboratory) -> np.ndarray:
    return laboratory.scene(np.zeros((2, 2)))


def test_the_reference_has_the_colours_of_colour_science() -> None:
    chart = colour.CCS_COLOURCHECKERS['ColorChecker24 - After November 2014']
    xyz = colour.xyY_to_XYZ(np.array(list(chart.data.values())))
    published = colour.XYZ_to_RGB(
        xyz, 'sRGB', illuminant=chart.illuminant, chromatic_adaptation_transform='Bradford'
    )
    np.testing.assert_allclose(REFERENCE, published, atol=1e-4)


@pytest.mark.parametrize('error', [(0, 0), (12, -8), (-15, 10), (18, 14)])
def test_the_chart_is_found_near_its_known_place(picture, error) -> None:
    found = colour_checker.find_checker(picture, CORNERS + error)
    assert found is not None
    assert found.moved_px == pytest.approx(np.hypot(*error), abs=2.5)
    np.testing.assert_allclose(found.patches, np.clip(REFERENCE, 0.005, 1), atol=0.02)


def test_a_picture_without_a_chart_gives_none(picture) -> None:
    grains = np.random.default_rng(4).uniform(0.2, 0.4, picture.shape).astype(np.float32)
    assert colour_checker.find_checker(grains, CORNERS) is None
    assert colour_checker.find_checker(np.full_like(picture, 0.3), CORNERS) is None
    assert colour_checker.find_checker(picture, CORNERS + np.array([300, 250])) is None


@pytest.mark.parametrize('patch', [0, 9, 18, 20])
@pytest.mark.parametrize('value', [0.0, 1.0], ids=['covered', 'over-exposed'])
def test_one_spoiled_patch_changes_neither_place_nor_colours(picture, patch, value) -> None:
    row, column = divmod(patch, 6)
    first_row, first_column = 25 + 25 * row, 60 + 25 * column
    picture[first_row - 3 : first_row + 23, first_column - 3 : first_column + 23] = value
    found = colour_checker.find_checker(picture, CORNERS + np.array([7, 5]))
    assert found is not None
    matrix, kept = colour_checker.fit_matrix(found.patches, REFERENCE)
    assert not kept[patch]
    np.testing.assert_allclose(matrix, np.eye(3), atol=0.03)


def test_the_matrix_of_a_camera_is_recovered() -> None:
    camera = np.array([[0.8, 0.15, 0.02], [0.1, 0.7, 0.1], [0.0, 0.1, 0.6]])
    matrix, kept = colour_checker.fit_matrix(REFERENCE @ camera.T, REFERENCE)
    np.testing.assert_allclose(matrix @ camera, np.eye(3), atol=1e-6)
    assert kept.all()


def test_a_covered_patch_does_not_change_the_gain() -> None:
    gain = np.array([1.08, 1.1, 0.93])
    later = REFERENCE * gain
    later[20] = 0.0
    np.testing.assert_allclose(colour_checker.log_gain(later, REFERENCE), np.log(gain), atol=1e-6)


def test_a_chart_that_is_dark_in_one_channel_gives_no_gain() -> None:
    yellowish = REFERENCE * [1.0, 1.0, 0.06]
    assert colour_checker.log_gain(yellowish * 1.1, yellowish) is None
    assert colour_checker.log_gain(REFERENCE, REFERENCE + np.array([1.0, 0.0, 0.0])) is None


def test_another_tone_curve_is_seen_at_the_chart_although_a_patch_is_covered() -> None:
    gain, power = np.array([1.1, 0.9, 1.0]), 0.2
    later = gain * np.maximum(REFERENCE, 0.0) ** (1.0 + power)
    later[5] *= 0.3
    light = colour_checker.chart_light(later, REFERENCE)
    assert light is not None
    assert light.power == pytest.approx(power, abs=0.01)
    np.testing.assert_allclose(light.straight_gain, np.log(gain) / (1.0 + power), atol=0.01)


@pytest.mark.parametrize('offset', [-0.01, 0.005, 0.02, 0.08])
def test_haze_over_the_chart_is_seen_although_patches_are_covered(offset: float) -> None:
    later = np.maximum(0.8 * REFERENCE + offset, 0.0)
    later[[5, 20]] *= 0.3
    light = colour_checker.chart_light(later, REFERENCE)
    assert light is not None
    assert light.power == 0.0
    np.testing.assert_allclose(light.veil, offset, atol=0.001)
    np.testing.assert_allclose(light.straight_gain, np.log(0.8), atol=0.01)


def test_light_alone_is_no_haze_over_the_chart() -> None:
    light = colour_checker.chart_light(0.8 * REFERENCE, REFERENCE)
    assert light is not None
    assert (light.power, light.veil) == (0.0, None)
    np.testing.assert_array_equal(light.straight_gain, light.log_gain)
