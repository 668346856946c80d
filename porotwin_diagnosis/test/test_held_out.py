"""The share of a gap that closes, with its interval, for one recording and for several."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_diagnosis.data.noise import Noise, blurred, noise_floor
from porotwin_diagnosis.decision.held_out import (
    HeldOut,
    bounded_floor,
    camera_errors,
    gap_closed_with_interval,
)

TRUTH = np.random.default_rng(3).random((8, 20, 30))


def part(before, after, *, uneven=0.0, floor=0.02):
    """Return a part with the errors `before` and `after`, larger to the right by `uneven`."""
    noise = np.random.default_rng(5).normal(size=TRUTH.shape)
    noise = noise * (1.0 + uneven * np.linspace(-1.0, 1.0, 30))
    noise /= np.linalg.norm(noise) / np.linalg.norm(TRUTH)
    maps = (TRUTH + before * noise, TRUTH + after * noise)
    errors = [np.linalg.norm(shown - TRUTH) / np.linalg.norm(TRUTH) for shown in maps]
    return HeldOut(np.arange(8.0), TRUTH, *maps, *errors, floor, 0.0)


def test_the_interval_holds_the_estimate_and_is_the_same_each_time():
    held = part(0.3, 0.08, uneven=0.8)
    closed, (low, high) = gap_closed_with_interval([held])
    assert 0.0 <= low <= closed <= high <= 1.0
    assert (closed, (low, high)) == gap_closed_with_interval([part(0.3, 0.08, uneven=0.8)])


def test_the_interval_of_an_uneven_gap_is_wider():
    after = TRUTH.copy()
    after[:, :, :15] *= 1.2  # one half is as wrong as before, the other is corrected
    held = HeldOut(np.arange(8.0), TRUTH, 1.2 * TRUTH, after, 0.2, 0.2 / np.sqrt(2), 0.01, 0.0)
    _, (low, high) = gap_closed_with_interval([held])
    _, (even_low, even_high) = gap_closed_with_interval([part(0.2, 0.2 / np.sqrt(2), floor=0.01)])
    assert high - low > 3 * (even_high - even_low)


def test_nothing_closes_where_there_is_no_gap():
    held = part(0.02, 0.01, floor=0.03)
    closed, (low, _) = gap_closed_with_interval([held])
    assert closed == low == 0.0


def test_a_recording_without_a_gap_does_not_change_the_share_of_another():
    with_gap, without = part(0.4, 0.03), part(0.021, 0.021)
    closed, (low, high) = gap_closed_with_interval([with_gap, without])
    assert closed == pytest.approx(0.97, abs=0.03)
    assert low <= closed <= high


def test_cells_that_are_never_seen_do_not_count():
    seen = part(0.3, 0.1)
    observed = TRUTH.copy()
    observed[:, :, -3:] = np.nan
    held = HeldOut(seen.times, observed, seen.before, seen.after, 0.3, 0.1, 0.02, 0.0)
    assert np.isfinite(gap_closed_with_interval([held])[1]).all()
    assert (held.remainder[:, -3:] == 0.0).all()
    assert held.remainder[:, :-3].mean() > 0.0


def test_errors_of_several_recordings_are_combined_as_root_mean_square():
    assert camera_errors([part(0.10, 0.11)]) == pytest.approx((0.10, 0.11))
    both = camera_errors([part(0.20, 0.05), part(0.10, 0.11)])
    assert both == pytest.approx((np.sqrt(0.025), np.sqrt(0.0073)))


def test_another_blur_changes_the_noise_floor_and_nothing_else():
    held = part(0.3, 0.1)
    noise = Noise(0.03, 0.008, 0.004, 1.0)
    sharp, wide = (held.assuming_point_spread(width, noise) for width in (0.0, 1.0))
    assert (sharp.point_spread_width, wide.point_spread_width) == (0.0, 1.0)
    assert wide.noise_floor > sharp.noise_floor > 0.0
    assert wide.error_after == held.error_after


def test_camera_errors_show_an_improvement_that_the_blur_of_the_camera_hides():
    """A response that thins the fringe is right, and looks wrong beside a blurred picture."""
    x = np.arange(30.0)
    shown = np.broadcast_to(np.clip((24.0 - x) / 4.0, 0.0, 1.0), TRUTH.shape)
    thinned = shown**1.5
    observed = blurred(thinned, 1.0)
    errors = [
        np.linalg.norm(maps - observed) / np.linalg.norm(observed) for maps in (shown, thinned)
    ]
    held = HeldOut(np.arange(8.0), observed, shown, thinned, *errors, 0.02, point_spread_width=1.0)
    before, after = camera_errors([held])
    assert after < 1e-9 < 0.02 < before
    assert errors[1] > 0.02


def test_camera_errors_show_an_improvement_that_the_level_of_calibrated_maps_hides():
    """Maps 6 % too pale fit a model with a misplaced, paler plume as well as the true one."""
    true, wrong = 1.0 * TRUTH, 0.94 * TRUTH
    wrong[..., -1] += 0.04
    observed = 0.94 * TRUTH
    held = HeldOut(np.arange(8.0), observed, wrong, true, 0.05, 0.06, 0.0, 0.0, level_known=False)
    before, after = camera_errors([held])
    assert after < 1e-9 < 0.004 < before
    before, after = camera_errors([replace(held, level_known=True)])
    assert before < after
    far = replace(held, observed=0.5 * TRUTH)
    assert camera_errors([far])[1] == pytest.approx(0.7)  # no calibration is so far off


def test_a_model_that_errs_less_than_the_stated_noise_bounds_the_noise_floor():
    stated = Noise(0.0, 0.004, 0.004, 1.0, random=(0.1, 0.1), systematic=(0.0, 0.0))
    close, far = part(0.3, 0.02).after, part(0.3, 0.3).after
    assert bounded_floor(stated, close, TRUTH) == pytest.approx(0.02, rel=0.01)
    assert bounded_floor(stated, far, TRUTH) == noise_floor(stated, far, TRUTH) < 0.3
    noisy = Noise(0.0, 0.05, 0.05, 1.0, random=(0.1, 0.1), systematic=(0.0, 0.0))
    assert bounded_floor(noisy, close, TRUTH) > 0.05
