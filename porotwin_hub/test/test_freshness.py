"""Tests of the age of photographs: which are too late to act on, whatever the camera's clock."""

import pytest

from porotwin_hub.freshness import PhotographClock

NOW = 1.8e9
"""Seconds since 1970 when the first photograph of a test arrives."""


def lateness(*photographs: tuple[float, float]) -> list[float]:
    """Return how late photographs are, given as (stamp, arrival) [s] after `NOW`."""
    clock = PhotographClock(interval=30.0, validity=90.0)
    return [round(clock.lateness(NOW + stamp, NOW + arrival)) for stamp, arrival in photographs]


def in_time(*photographs: tuple[float, float]) -> list[bool]:
    return [late <= 90.0 for late in lateness(*photographs)]


def live(count: int, *, after: float = 0.0, ahead: float = 0.0) -> list[tuple[float, float]]:
    """Return photographs that arrive 2 s after they are taken, by a clock that is `ahead` [s]."""
    return [(after + 30.0 * n + ahead, after + 30.0 * n + 2.0) for n in range(count)]


def backlog(count: int, *, age: float) -> list[tuple[float, float]]:
    """Return photographs that begin `age` [s] ago and arrive one a second."""
    return [(30.0 * n - age, float(n)) for n in range(count)]


def test_live_photographs_are_in_time() -> None:
    assert lateness(*live(5)) == [2] * 5


@pytest.mark.parametrize('age', [3600.0, 7 * 86400.0])
def test_last_weeks_photographs_are_not_acted_on(age: float) -> None:
    assert not any(in_time(*backlog(40, age=age)))
    assert in_time(*backlog(40, age=age), *live(2, after=60.0))[-2:] == [True, True]


def test_the_newest_photographs_of_a_short_backlog_are_in_time() -> None:
    assert in_time(*backlog(10, age=300.0)) == [False] * 8 + [True] * 2


def test_photographs_that_come_again_are_not_acted_on() -> None:
    again = [(30.0 * n, 3600.0 + n) for n in range(100)]
    assert in_time(*live(121), *again)[121:] == [False] * 100


@pytest.mark.parametrize('ahead', [-7200.0, -86400.0 * 365])
def test_a_camera_whose_clock_is_behind_is_trusted_from_its_second_photograph(
    ahead: float,
) -> None:
    assert in_time(*live(5, ahead=ahead)) == [False, True, True, True, True]


def test_a_camera_whose_clock_is_ahead_is_trusted_and_its_old_photographs_are_not() -> None:
    again = [(7200.0 + 30.0 * n, 3600.0 + n) for n in range(50)]
    assert in_time(*live(121, ahead=7200.0), *again) == [True] * 121 + [False] * 50


def test_photographs_that_lag_more_and_more_become_late_at_a_live_pace() -> None:
    lagging = [(30.0 * n, 36.0 * n) for n in range(20)]
    assert in_time(*lagging) == [True] * 16 + [False] * 4


def test_a_clock_set_back_costs_one_photograph() -> None:
    assert in_time(*live(5), *live(5, after=150.0, ahead=-3600.0)) == [True] * 5 + [
        False, True, True, True, True,
    ]  # fmt: skip


def test_stamps_since_the_start_of_an_experiment_tell_no_age() -> None:
    clock = PhotographClock(interval=30.0, validity=90.0)
    assert clock.lateness(1800.0, NOW) == 0.0
    assert clock.lateness(9000.0, NOW + 1.0) == 0.0
