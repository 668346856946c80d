"""The noise model: moments after clipping, and the noise floor."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_diagnosis.data.noise import Noise, blurred, noise_floor


def test_mean_and_deviation_after_clipping_agree_with_random_draws():
    noise = Noise(0.05, 0.02, 0.01, 1.0)
    generator = np.random.default_rng(5)
    for c in (0.0, 0.5, 0.98, 1.0):
        draws = c + noise.deviation(np.array(c)) * generator.standard_normal(200_000)
        draws = np.clip(draws, 0, 1)
        assert noise.expected(np.array(c)) == pytest.approx(draws.mean(), abs=3e-4)
        rms = np.sqrt(np.mean((draws - c) ** 2))
        assert noise.clipped_deviation(np.array(c)) == pytest.approx(rms, rel=0.01)


def test_the_noise_floor_is_the_error_of_the_true_maps():
    noise = Noise(0.0, 0.03, 0.01, 1.0, point_spread_width=0.8)
    generator = np.random.default_rng(11)
    x = np.linspace(-3.0, 3.0, 60)
    true = np.broadcast_to(0.5 * (1 - np.tanh(x)), (40, 30, 60))
    shown = blurred(true, noise.point_spread_width)
    observed = shown + noise.deviation(shown) * generator.standard_normal(true.shape)
    observed = np.clip(observed, 0, 1)
    error = np.linalg.norm(observed - true) / np.linalg.norm(observed)
    assert noise_floor(noise, true, observed) == pytest.approx(error, rel=0.02)


def test_unseen_cells_have_no_part_in_the_noise_floor():
    noise = Noise(0.02, 0.01, 0.01, 1.0)
    true = np.full((2, 10, 10), 0.5)
    hidden = true.copy()
    hidden[:, :, 5:] = np.nan
    halved = true.copy()[:, :, :5]
    assert noise_floor(noise, true, hidden) == pytest.approx(noise_floor(noise, halved, halved))


def test_without_delivered_deviations_the_measured_noise_counts():
    noise, level = Noise(0.02, 0.01, 0.005, 1.0), np.linspace(0, 1, 7)
    measured = noise.clipped_deviation(level)
    assert noise.with_delivered(measured, level) is measured


def test_the_noise_floor_of_smoothed_maps_holds_their_delivered_errors():
    model = np.full((3, 20, 30), 0.5)
    observed = 1.04 * model  # a wrong scale, and no noise at all
    smooth = Noise(0.0, 0.0, 0.0, 1.0)
    honest = replace(smooth, random=(0.0, 0.0), systematic=(0.0, 0.04))
    assert noise_floor(smooth, model, observed) < 1e-3
    assert noise_floor(honest, model, observed) == pytest.approx(0.02 / 0.52, rel=1e-3)


def test_the_larger_of_measured_and_delivered_noise_counts():
    noise = Noise(0.0, 0.0, 0.0, 1.0, random=(0.01, 0.03), systematic=(0.0, 0.04))
    found = noise.with_delivered(np.array([0.02, 0.02]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(found, [0.02, 0.05])
