"""Another gamma and haze are found from dark and bright sand, and undone."""

import numpy as np
import pytest

from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.light.tone_change import ToneChange, tone_change
from porotwin_imaging.photo_to_map import concentration_map

SHAPE = (40, 80)
ALL = np.ones(SHAPE, bool)
TRACER = (slice(10, 25), slice(20, 45))


def sand() -> np.ndarray:
    """Return linear light of a baseline with three sands, shape (40, 80, 3)."""
    light = np.full((*SHAPE, 3), 0.3, np.float32)
    light[:15] = 0.1
    light[30:] = 0.18
    return light * np.array([1.0, 0.8, 0.6], np.float32)


def ratio(state: np.ndarray) -> np.ndarray:
    """Return the log ratio to `sand` with noise."""
    noise = np.random.default_rng(5).normal(0, 0.01, state.shape)
    return (np.log(state / sand()) + noise).astype(np.float32)


def with_tracer() -> np.ndarray:
    light = sand()
    light[TRACER] *= np.exp([-1.2, -0.7, -1.4])
    return light


def change_of(state: np.ndarray, visible: np.ndarray = ALL) -> ToneChange | None:
    """Return the change of tone of a photograph of `sand` with the linear light `state`."""
    return tone_change(ratio(state), sand(), state, visible, None)


@pytest.mark.parametrize('gamma', [0.85, 0.93, 1.1])
def test_a_gamma_is_found_and_undone(gamma: float) -> None:
    found = change_of(0.9 * with_tracer() ** gamma)
    assert found is not None
    assert found.kind == 'curve'
    assert 1 + found.amount == pytest.approx(gamma, abs=0.01)
    undone = found.undone(ratio(with_tracer() ** gamma), sand())
    tracer = undone[TRACER].mean(axis=(0, 1)) - undone[:, 60:].mean(axis=(0, 1))
    np.testing.assert_allclose(tracer, [-1.2, -0.7, -1.4], atol=0.05)
    assert found.remark.startswith('tone curve of the camera has changed (gamma')


@pytest.mark.parametrize('haze', [0.01, 0.04])
def test_haze_is_found_in_every_channel(haze: float) -> None:
    colour = np.ones(3)
    found = change_of(0.95 * with_tracer() + haze * colour)
    assert found is not None
    assert found.kind == 'haze'
    assert found.amount == pytest.approx(haze, rel=0.15)
    np.testing.assert_allclose(found.veil, haze * colour, rtol=0.15)
    assert '% more light on dark sand: corrected' in found.remark


def test_drift_and_tracer_are_no_change_of_tone() -> None:
    assert change_of(1.05 * with_tracer()) is None
    assert change_of(with_tracer(), np.zeros(SHAPE, bool)) is None
    even = np.full((*SHAPE, 3), 0.2)
    assert tone_change(ratio(sand() ** 0.9), even, even**0.9, ALL, None) is None


def test_the_curve_keeps_the_log_ratio_at_its_reference() -> None:
    change = ToneChange('curve', 0.1, 0.2)
    light = np.full((1, 1, 3), 0.2)
    np.testing.assert_allclose(change.undone(np.full((1, 1, 3), -0.55), light), -0.5)


def test_another_gamma_leaves_the_map(
    new_laboratory, calibration, no_tracer, true_map, relative_error, make_jpeg
) -> None:
    laboratory = new_laboratory(finer_below=0.2)
    rig = laboratory.rig
    empty = laboratory.photograph(no_tracer, seed=1)
    baseline = make_baseline(rig, rig.grid(90, 50), [empty], calibration=calibration)
    still = concentration_map(laboratory.photograph(true_map), baseline)
    found = concentration_map(make_jpeg(laboratory.scene(true_map) ** 0.9), baseline)
    assert any('tone curve of the camera has changed' in line for line in found.status)
    assert relative_error(found.values, true_map) < relative_error(still.values, true_map) + 0.02


def test_coarse_grains_in_a_shaken_photograph_are_no_change_of_tone() -> None:
    grains = np.exp(np.random.default_rng(3).normal(0, 0.12, (160, 321, 1)))
    shaken = 0.8 * grains[:, :-1] + 0.2 * grains[:, 1:]  # a fifth of a cell to the side
    light = np.full((160, 320, 3), 0.3)
    light[:60] = 0.22
    before, state = light * grains[:, :-1], light * shaken
    visible = np.ones(before.shape[:2], bool)
    assert tone_change(np.log(state / before), before, state, visible, None) is None
