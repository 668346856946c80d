"""Tests of the watch over pumps without meters, with photographs of a few blocks."""

import numpy as np
import pytest

from porotwin_hub.estimation.pump_watch import REST_S, Expectations, PumpWatch, likeliest
from porotwin_hub.models.plant_knowledge import STANDS

BLOCKS = 40
USUAL = np.full(BLOCKS, 0.5)
PUSH = np.where(np.arange(BLOCKS) < 20, 0.3, 0.0)
MORE = np.where(np.arange(BLOCKS) < 10, -0.3, 0.0)
OTHER = np.where(np.arange(BLOCKS) < 20, 0.0, 0.3)
VARIANCE = np.full(BLOCKS, 4.0 * 0.02**2)


def photograph(observed: np.ndarray, usual: np.ndarray = USUAL) -> Expectations:
    """Return a photograph where 'push' and 'other' change one half of the blocks each."""
    doubts = 0.06 * np.array([PUSH, OTHER, MORE])
    changed = {('push', 0.0): USUAL + PUSH, ('push', 2.0): USUAL + MORE}
    changed[('other', 0.0)] = USUAL + OTHER
    return Expectations(observed, usual, changed, VARIANCE, doubts)


def told(watch: PumpWatch, seen: Expectations, times: int = 2) -> list[str]:
    return [line for _ in range(times) for line in watch.test(lambda: seen)]


def test_a_stopped_pump_is_told_once_after_two_photographs() -> None:
    watch = PumpWatch()
    assert told(watch, photograph(USUAL + PUSH), 1) == []
    (line,) = told(watch, photograph(USUAL + PUSH), 1)
    assert line.startswith('push seems to deliver nothing')
    assert watch.share('push') == STANDS
    assert watch.share('other') == 1.0


def test_a_pump_at_a_part_of_its_rate_is_told_with_that_part() -> None:
    watch = PumpWatch()
    (line,) = told(watch, photograph(USUAL + 0.6 * PUSH))
    assert 'about 40 % of its rate' in line
    assert watch.share('push') == pytest.approx(0.4, abs=0.02)


def test_a_pump_at_twice_its_rate_is_told_with_that_rate() -> None:
    watch = PumpWatch()
    (line,) = told(watch, photograph(USUAL + MORE))
    assert line.startswith('push seems to deliver about 200 % of its rate')
    assert watch.share('push') == pytest.approx(2.0, abs=0.03)


def test_a_fault_that_becomes_worse_is_not_taken_back() -> None:
    watch = PumpWatch()
    told(watch, photograph(USUAL + 0.6 * PUSH))
    stops = Expectations(
        USUAL + PUSH, USUAL + 0.6 * PUSH, {('push', 1.0): USUAL}, VARIANCE, np.zeros((1, BLOCKS))
    )
    assert told(watch, stops) == []
    assert watch.share('push') == pytest.approx(0.4, abs=0.02)


def test_a_weak_pump_is_no_fault() -> None:
    watch = PumpWatch()
    assert told(watch, photograph(USUAL + 0.2 * PUSH), 10) == []
    assert told(watch, photograph(USUAL + 0.2 * MORE), 10) == []
    assert watch.faults == {}


def test_noise_is_no_fault() -> None:
    generator, watch = np.random.default_rng(7), PumpWatch()
    for _ in range(200):
        assert watch.test(lambda: photograph(generator.normal(USUAL, 0.04))) == []


def test_another_cause_is_no_fault() -> None:
    stripes = 0.3 * np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)
    assert told(PumpWatch(), photograph(USUAL + 0.3 * PUSH + stripes), 10) == []


def test_the_likeliest_share_is_found() -> None:
    well, share, log_odds = likeliest(photograph(USUAL + 0.75 * OTHER))
    assert (well, share) == ('other', pytest.approx(0.25, abs=0.02))
    assert log_odds > 8.0


def test_a_fault_is_taken_back_when_photographs_say_so() -> None:
    watch = PumpWatch()
    told(watch, photograph(USUAL + PUSH))
    changed = {('push', 1.0): USUAL}
    doubts = np.zeros((1, BLOCKS))
    works = Expectations(USUAL, USUAL + PUSH, changed, VARIANCE, doubts)
    (line,) = told(watch, works)
    assert line.startswith('push delivers again')
    assert watch.share('push') == 1.0


def test_a_faulty_pump_is_tried_again_after_a_rest() -> None:
    watch = PumpWatch()
    told(watch, photograph(USUAL + PUSH))
    watch.rest(['push'], REST_S)
    assert watch.share('push') == STANDS
    watch.rest(['push'], 1.0)
    assert watch.share('push') == 1.0
