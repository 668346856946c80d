"""The noise of maps, measured from the maps themselves."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.ndimage import gaussian_filter

from porotwin_diagnosis.data.noise import Noise, measure_noise
from porotwin_recording.recording import open_recording

CASES = Path(__file__).resolve().parents[2].parent / 'shared' / 'cases'


def plume(shape=(60, 90), radius=18.0):
    z, x = np.mgrid[: shape[0], : shape[1]]
    distance = np.hypot(x - shape[1] / 2, z - shape[0] / 2)
    return 0.5 * (1 - np.tanh((distance - radius) / 2))


def recorded(noise, frames=30, seed=11, level=1.0):
    """Maps of a plume with a known noise, made here and clipped as a camera does."""
    return noisy([level * plume()] * frames, noise, seed)


def noisy(clean_maps, noise, seed):
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
    found = measure_noise(recorded(truth))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(grain, frame), rel=0.2)
    assert found.background == pytest.approx(0.5 * frame, rel=0.15)
    assert found.correlation == pytest.approx(0.8, abs=0.25)


@pytest.mark.parametrize('width', [0.6, 0.9, 1.2])
def test_the_noise_of_a_pale_plume_is_measured_however_wide_its_grain(width):
    truth = Noise(0.03, 0.01, 0.005, correlation=width)
    found = measure_noise(recorded(truth, level=0.85))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(0.03, 0.01), rel=0.2)
    assert found.correlation == pytest.approx(width, rel=0.2)


@pytest.mark.parametrize('seed', range(4))
def test_a_plume_that_is_full_at_few_places_is_measured_where_it_is_pale(seed):
    """It fades while it grows; the grain of the cells that were full may be far from typical."""
    truth = Noise(0.03, 0.01, 0.005, correlation=0.9)
    fading = [(1 - 0.02 * t) * plume((80, 90), 14.0 + t) for t in range(16)]
    found = measure_noise(noisy(fading, truth, seed))
    assert np.hypot(found.grain, found.frame) == pytest.approx(np.hypot(0.03, 0.01), rel=0.15)
    assert found.correlation == pytest.approx(0.9, rel=0.15)


def test_expected_map_is_the_mean_of_many_noisy_ones():
    noise = Noise(0.05, 0.02, 0.01)
    generator = np.random.default_rng(5)
    for c in (0.0, 0.5, 0.98, 1.0):
        draws = c + noise.deviation(np.array(c)) * generator.standard_normal(200_000)
        draws = np.clip(draws, 0, 1)
        assert noise.expected(np.array(c)) == pytest.approx(draws.mean(), abs=3e-4)
        rms = np.sqrt(np.mean((draws - c) ** 2))
        assert noise.clipped_deviation(np.array(c)) == pytest.approx(rms, rel=0.01)


@pytest.mark.skipif(not CASES.is_dir(), reason='needs ../shared/cases beside the repository')
@pytest.mark.parametrize('name', ['case_002', 'case_015', 'case_020'])
def test_noise_of_an_independent_camera_is_found(name):
    truth = yaml.safe_load((CASES / name / 'truth.yaml').read_text())['noise']
    found = measure_noise(open_recording(CASES / name).concentration)
    assert found.grain == pytest.approx(truth['grain_sd'], rel=0.15)
    background = truth['frame_sd'] * truth['background_share']
    assert found.background == pytest.approx(background, rel=0.15)


def test_a_plume_that_fades_from_one_side_to_the_other_is_no_grain():
    truth = Noise(0.03, 0.005, 0.003, correlation=0.8)
    fading = 1.0 - 0.5 * np.linspace(0.0, 1.0, 90)
    found = measure_noise(recorded(truth) * fading)
    assert found.correlation == pytest.approx(0.8, abs=0.25)


def test_maps_without_any_noise_have_a_noise_that_can_be_divided_by():
    found = measure_noise(np.clip(3.0 * np.stack([plume(radius=r) for r in range(4, 22)]), 0, 1))
    assert np.isfinite([found.grain, found.frame, found.background, found.correlation]).all()
