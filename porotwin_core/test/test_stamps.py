"""Stamps in words: dates since 1970, else a duration."""

import time

import pytest

from porotwin_core.clock.stamps import (
    believed_age,
    believed_start,
    set_ahead,
    steady_time,
    steady_time_of,
    time_in_words,
)


@pytest.mark.parametrize(
    ('stamp', 'words'),
    [
        (1.8e9 + 90.4, '2027-01-15 08:01:30 UTC'),
        (3690.0, '1:01:30'),
        (float('nan'), 'nan s'),
        (1e30, '1e+30 s'),
    ],
)
def test_a_stamp_is_a_date_or_a_duration(stamp: float, words: str) -> None:
    assert time_in_words(stamp) == words


@pytest.mark.parametrize(
    ('told', 'began', 'stamp', 'expected'),
    [
        (None, None, 2e9, 2e9),
        (None, 1.9e9, 2e9, 1.9e9),
        (2e9, None, 2e9, 2e9),  # the first photograph
        (2e9 - 3000.0, None, 2e9, 2e9 - 3000.0),  # a node that was started again
        (0.0, None, 2e9, 2e9),  # the clock of the camera was never set
        (3e9, None, 2e9, 2e9),
        (0.0, 1.9e9, 2e9, 1.9e9),
        (2e9, 1.9e9, 2e9, 2e9),  # another experiment begins
        (None, 0.0, 2e9, 2e9),  # a replay of a rig, in simulated time
        (2e9, 0.0, 2e9 + 30.0, 2e9),
        (2e9, 1.9e9, 2e9 + 30.0, 1.9e9),  # its first photograph was not believed
    ],
)
def test_the_start_of_an_experiment_is_believed_where_its_photograph_is(
    told: float | None, began: float | None, stamp: float, expected: float
) -> None:
    assert believed_start(told, began, stamp) == expected


@pytest.mark.parametrize(('now', 'age'), [(130.0, 30.0), (90.0, 0.0), (200.0, 0.0)])
def test_a_setpoint_of_a_camera_with_another_clock_counts_as_new(now: float, age: float) -> None:
    assert believed_age(100.0, now, 90.0) == age


def test_in_simulated_time_a_setpoint_may_overtake_the_clock() -> None:
    """The node has missed a tick of /clock; the setpoint holds until the same time all the same."""
    assert believed_age(100.0, 42.0, 90.0, simulated=True) == -58.0
    assert believed_age(100.0, 200.0, 90.0, simulated=True) == 100.0


def test_a_clock_that_is_set_changes_no_age(monkeypatch: pytest.MonkeyPatch) -> None:
    before, wall = steady_time(), time.time()
    monkeypatch.setattr(time, 'time', lambda: wall + 7200.3)
    assert 0.0 <= steady_time() - before < 60.0
    assert set_ahead() == 7200
    # files of this machine have its new time; those of a share, and older ones, their own
    assert steady_time_of(before + 7200.0, before) == before
    assert steady_time_of(before - 5.0, before) == before - 5.0
    monkeypatch.setattr(time, 'time', lambda: wall - 7200.0)
    assert steady_time_of(before - 7200.0, before) == before
