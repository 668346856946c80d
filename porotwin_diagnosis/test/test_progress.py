"""Tests of the progress of a diagnosis."""

import pytest

from porotwin_diagnosis.progress import (
    POSITIONS,
    SHARES,
    SINGLES_JUDGED,
    STAGE_ENDS,
    WorkClock,
    share_of_time,
    steps_of,
)


def test_all_stages_together_take_the_measured_shares() -> None:
    clock = WorkClock()
    assert (clock.share, clock.least_left) == (0.0, pytest.approx(0.105))
    for position in POSITIONS:
        clock.reach(position)
    assert clock.share == pytest.approx(1.0)
    assert clock.least_left == pytest.approx(0.0)
    assert sorted(SHARES) == list(SHARES)
    assert len(SHARES) == len(POSITIONS)


def test_stages_that_are_left_out_do_not_count_as_done() -> None:
    clock = WorkClock()
    clock.reach(0.24)
    assert clock.share == pytest.approx(share_of_time(0.24))
    assert clock.least_left < 0.05 < 1.0 - clock.share
    clock.reach(0.92)
    assert 0.5 < clock.share < 0.8
    assert clock.least_left == pytest.approx(1.0 - clock.share)


def test_the_share_never_falls() -> None:
    clock, before = WorkClock(), 0.0
    for position in (0.1, 0.05, 0.25, 0.3, 0.48, *STAGE_ENDS, 0.9, 1.0):
        clock.reach(position)
        assert clock.share >= before
        before = clock.share


def test_steps_count_when_they_end() -> None:
    told: list[tuple[str, float]] = []
    step = steps_of(lambda stage, position: told.append((stage, position)), 0.2, 0.1, 2)
    with step('first'), step('second'):
        assert told == [('first', 0.2), ('second', 0.2)]
    assert told[2:] == [('second', pytest.approx(0.25)), ('first', pytest.approx(0.3))]


def test_a_quick_search_has_one_end() -> None:
    clock = WorkClock(quick=True)
    for position in (0.01, SINGLES_JUDGED):
        clock.reach(position)
        assert clock.share + clock.least_left == pytest.approx(1.0)
    clock.reach(STAGE_ENDS[-1])
    assert clock.share + clock.least_left == pytest.approx(1.0)
