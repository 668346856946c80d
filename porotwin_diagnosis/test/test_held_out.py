"""How much of a gap closes, with an interval, of one recording and of several."""

import numpy as np
import pytest

from porotwin_diagnosis.data.noise import blurred
from porotwin_diagnosis.decision.held_out import HeldOut, softened, together, worsened

TRUTH = np.random.default_rng(3).random((8, 20, 30))


def part(before, after, *, uneven=0.0, floor=0.02):
    """Return a part whose errors are `before` and `after`, up to `uneven` worse to the right."""
    noise = np.random.default_rng(5).normal(size=TRUTH.shape)
    noise = noise * (1.0 + uneven * np.linspace(-1.0, 1.0, 30))
    noise /= np.linalg.norm(noise) / np.linalg.norm(TRUTH)
    maps = (TRUTH + before * noise, TRUTH + after * noise)
    errors = [np.linalg.norm(shown - TRUTH) / np.linalg.norm(TRUTH) for shown in maps]
    return HeldOut(np.arange(8.0), TRUTH, *maps, *errors, floor)


def test_the_interval_holds_the_estimate_and_is_the_same_each_time():
    held = part(0.3, 0.08, uneven=0.8)
    closed, (low, high) = together([held])
    assert 0.0 <= low <= closed <= high <= 1.0
    assert (closed, (low, high)) == together([part(0.3, 0.08, uneven=0.8)])


def test_an_uneven_gap_is_less_sure():
    after = TRUTH.copy()
    after[:, :, :15] *= 1.2  # one half stays as wrong as before, the other is mended
    held = HeldOut(np.arange(8.0), TRUTH, 1.2 * TRUTH, after, 0.2, 0.2 / np.sqrt(2), 0.01)
    _, (low, high) = together([held])
    _, (even_low, even_high) = together([part(0.2, 0.2 / np.sqrt(2), floor=0.01)])
    assert high - low > 3 * (even_high - even_low)


def test_nothing_closes_where_there_is_no_gap():
    held = part(0.02, 0.01, floor=0.03)
    closed, (low, _) = together([held])
    assert closed == low == 0.0


def test_a_recording_without_a_gap_does_not_water_down_another():
    with_gap, without = part(0.4, 0.03), part(0.021, 0.021)
    closed, (low, high) = together([with_gap, without])
    assert closed == pytest.approx(0.97, abs=0.03)
    assert low <= closed <= high


def test_cells_that_nobody_saw_do_not_count():
    seen = part(0.3, 0.1)
    observed = TRUTH.copy()
    observed[:, :, -3:] = np.nan
    held = HeldOut(seen.times, observed, seen.before, seen.after, 0.3, 0.1, 0.02)
    assert np.isfinite(together([held])[1]).all()
    assert (held.remainder[:, -3:] == 0.0).all()
    assert held.remainder[:, :-3].mean() > 0.0


def test_an_effect_with_which_the_error_grows_is_seen():
    assert softened([part(0.10, 0.11)]) == pytest.approx((0.10, 0.11))
    assert worsened([part(0.10, 0.11)])
    assert not worsened([part(0.20, 0.05), part(0.10, 0.11)])


def test_an_effect_that_changes_nothing_in_the_held_out_part_is_not_worse():
    """A late clock, where the pumps rest at last: its gap arose before."""
    assert not worsened([part(0.1000, 0.1008)])


def test_what_only_the_softness_of_the_camera_hides_is_seen():
    """A response that thins the fringe is right, and looks wrong beside a smeared picture."""
    x = np.arange(30.0)
    shown = np.broadcast_to(np.clip((24.0 - x) / 4.0, 0.0, 1.0), TRUTH.shape)
    thinned = shown**1.5
    observed = blurred(thinned, 1.0)
    errors = [
        np.linalg.norm(maps - observed) / np.linalg.norm(observed) for maps in (shown, thinned)
    ]
    held = HeldOut(np.arange(8.0), observed, shown, thinned, *errors, 0.02, blur=1.0)
    before, after = softened([held])
    assert after < 1e-9 < 0.02 < before
    assert errors[1] > 0.02
