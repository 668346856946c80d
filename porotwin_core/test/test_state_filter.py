"""Tests of the state filter: it beats the photograph, keeps volumes, and falls back on it."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import relative_error
from porotwin_core.model.state_filter import Estimate, Seen, StateFilter

SHAPE = (20, 30)
PORES = np.full(SHAPE, 1e-7)
SPACING = (0.01, 0.01)


def plume(shift: float) -> np.ndarray:
    """Return a plume with a smooth front at `shift` columns."""
    x = np.arange(SHAPE[1])
    return np.tile(1.0 / (1.0 + np.exp((x - shift) / 1.5)), (SHAPE[0], 1))


def photograph(truth: np.ndarray, generator: np.random.Generator, *, scale: float = 1.0) -> Seen:
    noisy = scale * truth + 0.02 * generator.standard_normal(SHAPE)
    return Seen(noisy, np.full(SHAPE, 0.02), 0.05 * np.clip(noisy, 0.0, 1.0))


def followed(scale: float = 1.0, slip: float = 0.0) -> tuple[list[float], list[float], Estimate]:
    """Return errors of photographs and states, and the last state, while a plume moves.

    Predictions miss each step by `slip` columns.
    """
    generator = np.random.default_rng(3)
    state_filter = StateFilter(PORES, SPACING)
    estimate = state_filter.begin(photograph(plume(5.0), generator, scale=scale))
    photo_errors, errors = [], []
    for step in range(1, 25):
        truth = plume(5.0 + 0.5 * step)
        seen = photograph(truth, generator, scale=scale)
        moved = (
            estimate.concentration
            + plume(5.0 + (0.5 + slip) * step)
            - plume(5.0 + 0.5 * (step - 1) + slip * step)
        )
        injected = float(np.sum(PORES * (truth - plume(5.0 + 0.5 * (step - 1)))))
        estimate = state_filter.update(estimate, np.clip(moved, 0, 1), seen, injected)
        photo_errors.append(float(np.std(seen.concentration - truth)))
        errors.append(float(np.std(estimate.concentration - truth)))
    return photo_errors, errors, estimate


def test_a_good_prediction_halves_the_noise_of_photographs() -> None:
    photo_errors, errors, _ = followed()
    assert np.mean(errors[5:]) < 0.5 * np.mean(photo_errors[5:])


def test_a_poor_prediction_leaves_the_photograph() -> None:
    photo_errors, errors, _ = followed(slip=0.4)
    assert np.mean(errors[5:]) < 1.2 * np.mean(photo_errors[5:])


def test_pumps_tell_the_scale_of_the_photographs() -> None:
    _, _, estimate = followed(scale=1.06)
    start = followed(scale=1.0)[2]
    assert estimate.volume.scale > start.volume.scale + 0.1


def test_the_volume_is_kept_where_photographs_say_nothing_else() -> None:
    state_filter = StateFilter(PORES, SPACING)
    first = Seen(plume(8.0), np.full(SHAPE, 0.02), np.zeros(SHAPE))
    estimate = state_filter.begin(first)
    unseen = Seen(np.full(SHAPE, np.nan), np.full(SHAPE, 0.02), np.zeros(SHAPE))
    moved = np.roll(estimate.concentration, 1, axis=1)
    after = state_filter.update(estimate, moved, unseen, 0.0)
    np.testing.assert_allclose(after.concentration, moved)
    assert np.sum(PORES * after.concentration) == pytest.approx(np.sum(PORES * moved))


def test_unseen_cells_take_the_prediction_and_all_stay_concentrations() -> None:
    generator = np.random.default_rng(5)
    state_filter = StateFilter(PORES, SPACING)
    estimate = state_filter.begin(photograph(plume(5.0), generator))
    seen = photograph(plume(6.0), generator)
    seen.concentration[3:6, 2:12] = np.nan
    after = state_filter.update(estimate, plume(6.0), seen, 0.0)
    np.testing.assert_allclose(after.concentration[3:6, 2:12], plume(6.0)[3:6, 2:12], atol=0.05)
    assert 0.0 <= after.concentration.min() <= after.concentration.max() <= 1.0
    assert np.isnan(after.observed[3:6, 2:12]).all()


def test_a_map_without_deviations_has_usual_ones() -> None:
    values = np.array([[0.5, np.nan]])
    seen = Seen.of(values, None, None)
    assert (seen.random > 0.0).all()
    assert np.isfinite(seen.systematic).all()
    given = Seen.of(np.array([[0.5, 0.5]]), np.array([[0.05, np.nan]]), np.array([[0.03, np.nan]]))
    assert given.random[0, 0] == pytest.approx(0.04)
    assert given.random[0, 1] == pytest.approx(seen.random[0, 0])


def test_a_long_injection_keeps_the_volume_in_spite_of_noise_above_zero() -> None:
    generator = np.random.default_rng(8)
    state_filter = StateFilter(PORES, SPACING)
    estimate = state_filter.begin(clipped_photograph(plume(2.0), generator))
    for step in range(1, 61):
        truth = plume(2.0 + 0.2 * step)
        injected = float(np.sum(PORES * (truth - plume(2.0 + 0.2 * (step - 1)))))
        moved = np.clip(estimate.concentration + truth - plume(2.0 + 0.2 * (step - 1)), 0.0, 1.0)
        estimate = state_filter.update(
            estimate, moved, clipped_photograph(truth, generator), injected
        )
    assert np.sum(PORES * estimate.concentration) == pytest.approx(np.sum(PORES * truth), rel=0.02)
    assert abs(estimate.volume.scale) < 0.6
    assert np.linalg.eigvalsh(estimate.volume.covariance).min() > -1e-18
    empty = truth < 1e-3
    assert estimate.concentration[empty].mean() < 0.001


def clipped_photograph(truth: np.ndarray, generator: np.random.Generator) -> Seen:
    """Return a photograph whose noise cannot fall below zero; 0.4 of it stays as a veil."""
    noisy = np.clip(truth + 0.01 * generator.standard_normal(SHAPE), 0.0, 1.0)
    return Seen(noisy, np.full(SHAPE, 0.01), 0.03 * noisy)


def test_the_expected_error_is_that_of_good_predictions_and_below_that_of_a_surprise() -> None:
    generator = np.random.default_rng(9)
    state_filter = StateFilter(PORES, SPACING)
    estimate = state_filter.begin(photograph(plume(5.0), generator))
    assert np.isnan(estimate.expected_error)
    ratios = []
    for step in range(1, 25):
        truth = plume(5.0 + 0.5 * step + (4.0 if step == 24 else 0.0))
        seen = photograph(truth, generator)
        moved = estimate.concentration + plume(5.0 + 0.5 * step) - plume(4.5 + 0.5 * step)
        predicted = np.clip(moved, 0.0, 1.0)
        estimate = state_filter.update(estimate, predicted, seen, 0.0)
        ratios.append(relative_error(predicted, estimate.observed) / estimate.expected_error)
    assert np.median(ratios[5:-1]) == pytest.approx(1.0, abs=0.3)
    assert ratios[-1] > 2.0
