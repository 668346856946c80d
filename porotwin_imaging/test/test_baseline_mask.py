"""The parts of a baseline that never show sand, on a drawn picture."""

import numpy as np
import pytest

from porotwin_imaging.baseline.baseline_mask import baseline_mask, texture

ROWS, COLUMNS = 300, 500
CHART = np.array([[400.0, 100], [400, 140], [460, 140], [460, 100]])


@pytest.fixture
def sand() -> np.ndarray:
    """Linear colours of coarse sand, shape (rows, columns, 3)."""
    generator = np.random.default_rng(14)
    grains = generator.uniform(0.5, 1.5, (ROWS, COLUMNS, 1))
    hues = generator.normal(1.0, 0.05, (ROWS, COLUMNS, 3))
    return (grains * hues * [0.2, 0.14, 0.1]).astype(np.float32)


def test_plain_sand_is_usable(sand) -> None:
    assert baseline_mask(sand, width_m=1.0, checker=None).usable.all()


def test_frame_and_glare_are_unlit(sand) -> None:
    sand[:, :30] = 0.001
    sand[200:220, 200:220] = 1.0
    unlit = baseline_mask(sand, width_m=1.0, checker=None).unlit
    assert unlit[:, :20].all()
    assert unlit[201:219, 201:219].all()
    assert not unlit[:, 250:].any()


def test_the_chart_is_masked_with_its_frame(sand) -> None:
    checker = baseline_mask(sand, width_m=1.0, checker=CHART).checker
    assert checker[95:146, 392:468].all()
    assert not checker[:80].any()


def test_smooth_water_above_the_sand_is_masked(sand) -> None:
    sand[:50] = [0.5, 0.5, 0.3]
    water = baseline_mask(sand, width_m=1.0, checker=None).water
    assert water[:48].all()
    assert not water[65:].any()


def test_a_tube_of_another_colour_is_an_object(sand) -> None:
    sand[100:200, 150:158] = [0.1, 0.05, 0.3]
    objects = baseline_mask(sand, width_m=1.0, checker=None).objects
    assert objects[105:195, 151:157].mean() > 0.95
    assert not objects[:, 250:].any()


def test_texture_is_relative_to_the_brightness(sand) -> None:
    np.testing.assert_allclose(np.median(texture(3 * sand)), np.median(texture(sand)), rtol=0.02)


def test_a_surface_in_the_lower_part_of_a_tall_picture_is_found(sand) -> None:
    sand[:140] = [0.5, 0.5, 0.3]
    water = baseline_mask(sand, width_m=1.0, checker=None).water
    assert water[:138].all()
    assert not water[155:].any()


def test_a_smooth_frame_around_the_sand_is_no_water_below_its_surface(sand) -> None:
    for strip in (sand[:22], sand[-22:], sand[:, :22], sand[:, -22:]):
        strip[:] = [0.35, 0.35, 0.36]
    mask = baseline_mask(sand, width_m=1.0, checker=None)
    assert mask.water[:18].all()
    assert mask.usable[50:-30, 30:-30].all()
