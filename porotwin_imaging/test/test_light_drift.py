"""The drift of light is separated from tracer."""

import numpy as np
import pytest

from porotwin_imaging.light.light_drift import light_drift

NZ, NX = 60, 100


def scene(*, tracer: float, gain: float, slope: float) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(31)
    z, x = np.meshgrid(np.linspace(-1, 1, NZ), np.linspace(-1, 1, NX), indexing='ij')
    light = np.log(gain) + slope * x + 0.3 * slope * z * x
    rim = 0.5 * (1 - np.tanh((np.hypot(x, z) - tracer) / 0.1)) if tracer else np.zeros((NZ, NX))
    noise = generator.normal(0, 0.01, (NZ, NX, 3))
    return light, light[..., None] - rim[..., None] * [1.2, 0.5, 0.8] + noise


@pytest.mark.parametrize('gain', [0.9, 1.0, 1.1])
@pytest.mark.parametrize('tracer', [0.0, 0.3, 0.6])
def test_drift_and_gradient_are_found_around_tracer(gain: float, tracer: float) -> None:
    light, ratio = scene(tracer=tracer, gain=gain, slope=0.04)
    found = light_drift(ratio, np.ones((NZ, NX)), None)
    assert np.abs(found.log_gain - light[..., None]).max() < 0.012


def test_a_change_of_the_colour_of_light_is_found() -> None:
    _, ratio = scene(tracer=0.3, gain=1.0, slope=0.0)
    found = light_drift(ratio + np.array([0.05, 0.0, -0.05]), np.ones((NZ, NX)), None)
    np.testing.assert_allclose(found.log_gain.mean(axis=(0, 1)), [0.05, 0, -0.05], atol=0.003)


def test_in_a_rig_full_of_tracer_the_chart_gives_the_drift() -> None:
    checker = np.log([0.95, 0.96, 0.94])
    ratio = np.full((NZ, NX, 3), [-1.2, -0.5, -0.8]) + checker
    ratio += np.random.default_rng(2).normal(0, 0.01, ratio.shape)
    found = light_drift(ratio, np.ones((NZ, NX)), checker)
    assert found.background == 0.0
    np.testing.assert_allclose(found.log_gain[3, 4], checker)


def test_a_background_of_one_cell_has_a_drift_without_shape() -> None:
    found = light_drift(np.full((1, 1, 3), 0.02), np.ones((1, 1)), None)
    np.testing.assert_allclose(found.log_gain, 0.02, rtol=1e-5)
