"""The colour of the tracer is found in a photograph, and tells tracer from shadow."""

import numpy as np
import pytest

from porotwin_imaging.tracer.tracer_colour import TracerColour, colour_in, local_noise, split

GREEN = (1.2, 0.7, 1.45)


def photograph(absorbance: tuple[float, float, float], *, noise: float = 0.01) -> np.ndarray:
    """Return log ratios with a square of tracer, shape (40, 80, 3)."""
    ratio = np.zeros((40, 80, 3))
    ratio[10:25, 20:40] = -np.array(absorbance)
    return ratio + np.random.default_rng(3).normal(0, noise, ratio.shape)


def test_a_shadow_has_no_hue() -> None:
    grey, hue = split(np.full((2, 3, 3), -0.4))
    np.testing.assert_allclose(grey, -0.4)
    np.testing.assert_allclose(hue, 0.0, atol=1e-12)


def test_the_hue_tells_the_darkening_by_tracer_behind_a_shadow() -> None:
    colour = TracerColour.of_absorbance(GREEN)
    assert colour is not None
    _, hue = split(np.full((1, 1, 3), -0.3) - 0.5 * np.array(GREEN))
    assert colour.amount(hue)[0, 0] == pytest.approx(0.5 * np.mean(GREEN))


def test_a_grey_dye_has_no_colour() -> None:
    assert TracerColour.of_absorbance((1.0, 1.02, 0.99)) is None
    assert colour_in(photograph((1.0, 1.02, 0.99)), np.ones((40, 80), bool)) is None


def test_the_colour_is_found_in_a_photograph() -> None:
    found = colour_in(photograph(GREEN), np.ones((40, 80), bool))
    expected = TracerColour.of_absorbance(GREEN)
    assert found is not None
    assert expected is not None
    np.testing.assert_allclose(found.direction, expected.direction, atol=0.01)
    assert found.strength == pytest.approx(expected.strength, rel=0.03)


def test_a_photograph_without_tracer_has_no_colour() -> None:
    assert colour_in(photograph((0.0, 0.0, 0.0)), np.ones((40, 80), bool)) is None
    assert colour_in(photograph(GREEN), np.zeros((40, 80), bool)) is None


def test_plumes_do_not_change_the_noise() -> None:
    noise = local_noise(photograph(GREEN, noise=0.02)[..., 0], np.ones((40, 80), bool))
    assert noise == pytest.approx(0.02, rel=0.1)
