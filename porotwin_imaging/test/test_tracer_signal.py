"""The tracer signal of log ratios."""

import numpy as np
import pytest

from porotwin_imaging.tracer.tracer_signal import TracerSignal, learned_weights


def test_absorbance_is_proportional_to_the_log_ratio() -> None:
    signal = TracerSignal('absorbance', (0.5, 0.3, 0.2))
    log_ratio = np.array([[[-1.0, -0.5, 0.0]]], np.float32)
    assert signal.of(log_ratio)[0, 0] == pytest.approx(0.65)
    assert signal.of(0.5 * log_ratio)[0, 0] == pytest.approx(0.325)


def test_the_noise_is_the_spread_of_the_signal() -> None:
    signal = TracerSignal('difference', (0.7, 0.2, 0.1))
    mean = np.array([-0.5, -0.2, -0.1])
    sampled = np.random.default_rng(12).normal(mean, 0.01, (200, 200, 3)).astype(np.float32)
    stated = signal.noise(mean[None, None], np.full((1, 1, 3), 1e-4))
    assert stated[0, 0] == pytest.approx(signal.of(sampled).std(), rel=0.05)


def test_learned_weights_avoid_the_channel_that_fluctuates() -> None:
    generator = np.random.default_rng(8)
    background = generator.normal(0, [0.01, 0.01, 0.2], (500, 3))
    tracer = -np.array([0.8, 0.4, 0.8]) + generator.normal(0, 0.01, (100, 3))
    red, green, blue = learned_weights(tracer, background)
    assert red > green > 0
    assert abs(blue) < 0.02
