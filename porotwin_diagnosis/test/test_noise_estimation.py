"""The noise of maps, estimated from the maps themselves."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.ndimage import gaussian_filter

from porotwin_diagnosis.data.noise import Noise, blurred
from porotwin_diagnosis.data.noise_estimation import (
    add_delivered,
    measure_noise,
    measure_point_spread_width,
)
from porotwin_recording.experiment.recording import open_recording

CASES = Path(__file__).resolve().parents[2].parent / 'shared' / 'cases'


def plume(shape=(60, 90), radius=18.0):
    z, x = np.mgrid[: shape[0], : shape[1]]
    distance = np.hypot(x - shape[1] / 2, z - shape[0] / 2)
    return 0.5 * (1 - np.tanh((distance - radius) / 2))


def noisy_plume(noise, frames=30, seed=11, level=1.0):
    """Return maps (frames, nz, nx) of a resting plume, as pale as `level`."""
    return noisy([level * plume()] * frames, noise, seed)


def noisy(clean_maps, noise, seed):
    """Return `clean_maps` with noise, clipped to 0..1 as by a camera."""
    generator = np.random.default_rng(seed)

    def correlated():
        field = gaussian_filter(generator.standard_normal(clean_maps[0].shape), noise.correlation)
        return field / field.std()

    grain = noise.grain * correlated()
    maps = []
    for clean in clean_maps:
        share = noise.background + (noise.frame - noise.background) * clean
        maps.append(np.clip(clean * (1 + grain) + share * correlated(), 0, 1))
    return np.array(maps)


@pytest.mark.parametrize('grain', [0.01, 0.03])
@pytest.mark.parametrize('frame', [0.006, 0.015])
def test_noise_is_measured_in_spite_of_clipping(grain, frame):
    truth = Noise(grain, frame, 0.5 * frame, correlation=0.8)
    found = measure_noise(noisy_plume(truth))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(grain, frame), rel=0.2)
    assert found.background == pytest.approx(0.5 * frame, rel=0.15)
    assert found.correlation == pytest.approx(0.8, abs=0.25)


def test_a_few_uneven_full_cells_say_nothing_about_the_grain():
    """Rings of many pulses leave few full cells, and those are uneven without any grain."""
    uneven = plume(radius=9.0) * np.where(np.arange(90) % 6 < 3, 1.0, 0.7)
    found = measure_noise(np.array([uneven] * 3))
    assert found.grain <= 0.02


@pytest.mark.parametrize('width', [0.6, 0.9, 1.2])
def test_the_noise_of_a_pale_plume_is_measured_for_any_width_of_the_grain(width):
    truth = Noise(0.03, 0.01, 0.005, correlation=width)
    found = measure_noise(noisy_plume(truth, level=0.85))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(0.03, 0.01), rel=0.2)
    assert found.correlation == pytest.approx(width, rel=0.2)


@pytest.mark.parametrize('seed', range(4))
def test_a_plume_with_few_full_cells_is_measured_where_it_is_pale(seed):
    """The plume fades while it grows. The grain of the few full cells need not be typical."""
    truth = Noise(0.03, 0.01, 0.005, correlation=0.9)
    fading = [(1 - 0.02 * t) * plume((80, 90), 14.0 + t) for t in range(16)]
    found = measure_noise(noisy(fading, truth, seed))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(0.03, 0.01), rel=0.15)
    assert found.correlation == pytest.approx(0.9, rel=0.15)


@pytest.mark.skipif(not CASES.is_dir(), reason='needs ../shared/cases beside the repository')
@pytest.mark.parametrize('name', ['case_002', 'case_015', 'case_020'])
def test_the_noise_of_an_independent_camera_is_found(name):
    truth = yaml.safe_load((CASES / name / 'truth.yaml').read_text())['noise']
    found = measure_noise(open_recording(CASES / name).concentration)
    assert found.grain == pytest.approx(truth['grain_sd'], rel=0.15)
    background = truth['frame_sd'] * truth['background_share']
    assert found.background == pytest.approx(background, rel=0.15)


def test_a_plume_that_fades_across_the_rig_is_not_grain():
    truth = Noise(0.03, 0.005, 0.003, correlation=0.8)
    fading = 1.0 - 0.5 * np.linspace(0.0, 1.0, 90)
    found = measure_noise(noisy_plume(truth) * fading)
    assert found.correlation == pytest.approx(0.8, abs=0.25)


def test_the_noise_of_maps_without_noise_is_finite():
    found = measure_noise(np.clip(3.0 * np.stack([plume(radius=r) for r in range(4, 22)]), 0, 1))
    assert np.isfinite([found.grain, found.frame, found.background, found.correlation]).all()


def test_the_point_spread_width_is_measured_beside_the_true_maps():
    noise = Noise(0.01, 0.005, 0.003, correlation=0.8)
    clean = np.stack([plume(radius=r) for r in np.linspace(8.0, 26.0, 16)])
    observed = noisy(list(blurred(clean, 0.7)), noise, seed=6)
    assert measure_point_spread_width(observed, clean, noise) == pytest.approx(0.7, abs=0.06)
    assert measure_point_spread_width(clean, blurred(clean, 0.7), noise) == 0.0


def test_delivered_deviations_are_kept_by_concentration():
    maps = np.array([[[0.0, 0.5, 1.0, 0.5, np.nan]]])
    deviation = np.array([[[0.01, 0.05, 0.03, 0.05, np.nan]]])
    systematic = np.array([[[0.0, 0.04, 0.03, 0.03, np.nan]]])
    noise = add_delivered(Noise(0.0, 0.0, 0.0, 1.0), maps, deviation, systematic)
    assert noise.random[0] == pytest.approx(0.01)
    assert noise.random[10] == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2))
    assert noise.systematic[10] == pytest.approx(np.sqrt((0.04**2 + 0.03**2) / 2))
    assert noise.systematic[15] == pytest.approx((noise.systematic[10] + 0.03) / 2, rel=0.01)


def test_a_few_odd_cells_in_a_clipped_core_are_no_grain():
    """In a core that a calibration takes for stock, nearly all values are clipped."""
    clipped = np.clip(1.05 * np.stack([plume()] * 20), 0.0, 1.0)
    odd = clipped.copy()
    odd[:, 28:32, 44] = 0.8
    assert measure_noise(clipped).grain < 0.02
    assert measure_noise(odd).grain <= 0.02
