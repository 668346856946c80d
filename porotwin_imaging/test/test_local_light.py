"""Soft shadows are removed, plumes in them stay, and ordinary photographs are not touched."""

import numpy as np
import pytest

from porotwin_imaging.light.local_light import local_light
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.tracer_colour import TracerColour

SHAPE = (75, 140)
DYE = np.array([1.2, 0.7, 1.45])
COLOUR = TracerColour.of_absorbance((1.2, 0.7, 1.45))


def rig_with(shadow: np.ndarray, tracer: np.ndarray) -> np.ndarray:
    """Return log ratios (nz, nx, 3) of sand with a shadow and tracer, both (nz, nx)."""
    noise = np.random.default_rng(2).normal(0, 0.01, (*SHAPE, 3))
    return shadow[..., None] - tracer[..., None] * DYE + noise


def places() -> tuple[np.ndarray, np.ndarray]:
    nz, nx = SHAPE
    z, x = np.mgrid[0 : 1 : nz * 1j, 0 : nx / nz : nx * 1j]
    return z, x


def soft_quarter(depth: float) -> np.ndarray:
    _, x = places()
    return depth * 0.5 * (1 + np.tanh((x - 1.3) / 0.1))


def disc(x0: float, z0: float, radius: float) -> np.ndarray:
    z, x = places()
    return 0.5 * (1 - np.tanh((np.hypot(x - x0, z - z0) - radius) / 0.03))


@pytest.mark.parametrize('depth', [-0.06, -0.3, 0.06])
def test_a_soft_shadow_is_found_below_a_plume(depth: float) -> None:
    shadow, tracer = soft_quarter(depth), disc(1.35, 0.5, 0.2)
    found = local_light(rig_with(shadow, tracer), np.ones(SHAPE, bool), COLOUR)
    assert found is not None
    assert np.abs(found.log_gain - shadow).mean() < 0.05 * abs(depth) + 0.002
    inside = tracer > 0.5
    assert np.abs((found.log_gain - shadow)[inside]).mean() < 0.1 * abs(depth) + 0.007
    assert (found.variance > 0).all()
    word = 'darker' if depth < 0 else 'brighter'
    assert any(f'% of the sand is {word} without the colour of tracer' in r for r in found.remarks)


@pytest.mark.parametrize('strength', [0.02, 0.1, 1.0])
def test_tracer_is_no_shadow(strength: float) -> None:
    for tracer in (disc(0.9, 0.5, 0.35), soft_quarter(1.0)):
        ratio = rig_with(np.zeros(SHAPE), strength * tracer)
        assert local_light(ratio, np.ones(SHAPE, bool), COLOUR) is None


def test_without_the_colour_of_tracer_nothing_is_corrected() -> None:
    ratio = rig_with(soft_quarter(-0.3), np.zeros(SHAPE))
    assert local_light(ratio, np.ones(SHAPE, bool), None) is None
    assert local_light(ratio, np.zeros(SHAPE, bool), COLOUR) is None


def test_a_shadow_on_a_photograph_leaves_the_map(
    baseline, laboratory, true_map, relative_error, make_jpeg
) -> None:
    light = laboratory.scene(true_map)
    columns = np.arange(light.shape[1])
    shadow = 1 - 0.25 / (1 + np.exp(-(columns - 500) / 30))
    found = concentration_map(make_jpeg(light * shadow[None, :, None]), baseline)
    assert any('without the colour of tracer' in line for line in found.status)
    assert np.isfinite(found.values).mean() > 0.97
    assert relative_error(found.values, true_map) < 0.06
    assert np.nanmax(found.values[:, 75:]) < 0.05
