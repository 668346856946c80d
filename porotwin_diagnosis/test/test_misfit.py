"""The misfit at the fronts, and the misfit that noise alone causes."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from porotwin_core.geometry.grid import Grid
from porotwin_diagnosis.data.misfit import misfit, noise_misfit
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import Sample

NOISE = Noise(0.03, 0.008, 0.004, correlation=0.8)


def discs(level):
    """Return discs of tracer (16, 60, 90), each wider than the one before, as pale as `level`."""
    z, x = np.mgrid[:60, :90]
    distance = np.hypot(x - 45, z - 30)
    radius = np.linspace(8.0, 26.0, 16)[:, None, None]
    return level * 0.5 * (1 - np.tanh((distance - radius) / 1.5))


def noisy(maps):
    """Return `maps` as a camera with `NOISE` would record them."""
    generator = np.random.default_rng(4)

    def correlated():
        field = gaussian_filter(generator.standard_normal(maps[0].shape), NOISE.correlation)
        return field / field.std()

    grain = 1 + NOISE.grain * correlated()
    share = NOISE.background + (NOISE.frame - NOISE.background) * maps
    return np.clip([m * grain + s * correlated() for m, s in zip(maps, share, strict=True)], 0, 1)


def sample_with(maps):
    return Sample(
        rig=None,
        schedule=None,
        grid=Grid(nx=90, nz=60, width=0.45, height=0.3),
        times=np.arange(16.0),
        observed=noisy(maps),
        fitted_frames=10,
        noise=NOISE,
        start=0.0,
        held_out_start=10.0,
        end=16.0,
    )


@pytest.mark.parametrize('level', [0.8, 0.88, 0.9, 0.92, 1.0])
def test_noise_in_a_pale_plume_is_no_gap(level):
    pale = discs(level)
    sample = sample_with(pale)
    residuals = [sample.whitened(pale)]
    total, noise = misfit([sample], residuals), noise_misfit([sample], residuals)
    assert total == pytest.approx(noise, rel=0.15)


def test_a_pale_plume_beside_a_full_prediction_is_a_gap():
    sample = sample_with(discs(0.8))
    residuals = [sample.whitened(discs(1.0))]
    assert min(misfit([sample], residuals)) > 5 * max(noise_misfit([sample], residuals))
