"""Tests of the age of photographs: which are too late to act on, whatever the camera's clock."""

from dataclasses import dataclass

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from porotwin_core.clock.freshness import AGREEMENT, LEARNING_PHOTOGRAPHS, PhotographClock

NOW = 1.8e9
"""Seconds since 1970 when the first photograph of a test is taken."""

INTERVAL = 30.0
VALIDITY = 90.0
HOUR = 3600.0
YEAR = 365 * 86400.0

Photograph = tuple[float, float]
"""Stamp and arrival [s] after `NOW`."""


def acted_on(*photographs: Photograph) -> list[bool]:
    """Return which photographs a setpoint may follow from."""
    clock = PhotographClock(interval=INTERVAL, validity=VALIDITY)
    judged = [clock.judge(NOW + stamp, NOW + arrival) for stamp, arrival in photographs]
    return [not one.doubt and one.age <= clock.most_age for one in judged]


def doubts(*photographs: Photograph) -> list[str]:
    clock = PhotographClock(interval=INTERVAL, validity=VALIDITY)
    return [clock.judge(NOW + stamp, NOW + arrival).doubt for stamp, arrival in photographs]


def live(count: int, *, after: float = 0.0, ahead: float = 0.0) -> list[Photograph]:
    """Return photographs that arrive 2 s after they are taken, by a clock that is `ahead` [s]."""
    return [
        (after + INTERVAL * n + ahead, after + INTERVAL * n + 2.0 + n % 3) for n in range(count)
    ]


def backlog(count: int, *, age: float) -> list[Photograph]:
    """Return photographs that begin `age` [s] ago and arrive one a second."""
    return [(INTERVAL * n - age, float(n)) for n in range(count)]


NEVER_SET = -NOW
"""How far a clock is ahead that counts from 1970 since the first photograph [s]."""


def test_live_photographs_are_in_time() -> None:
    assert acted_on(*live(5)) == [True] * 5


@pytest.mark.parametrize('age', [3600.0, 7 * 86400.0])
def test_last_weeks_photographs_are_not_acted_on(age: float) -> None:
    assert not any(acted_on(*backlog(40, age=age)))
    assert acted_on(*backlog(40, age=age), *live(2, after=60.0))[-2:] == [True, True]


def test_the_newest_photograph_of_a_short_backlog_is_in_time() -> None:
    assert acted_on(*backlog(10, age=300.0)) == [False] * 9 + [True]


@pytest.mark.parametrize('pause_after', [1, 20, 60, 119])
@pytest.mark.parametrize('pause', [15.0, 30.0, 60.0, 600.0])
def test_a_folder_that_is_sent_again_with_a_pause_is_not_acted_on(
    pause_after: int, pause: float
) -> None:
    again = [(INTERVAL * n, 3605.0 + n + pause * (n >= pause_after)) for n in range(120)]
    assert acted_on(*live(120), *again)[120:] == [False] * 120


@pytest.mark.parametrize('pauses', [{3}, {3, 4}, {3, 20, 60}])
def test_a_hub_without_a_past_does_not_act_on_a_backlog_that_pauses(pauses: set[int]) -> None:
    photographs, now = [], 0.0
    for number in range(100):
        now += INTERVAL if number in pauses else 0.3
        photographs.append((INTERVAL * number - 2 * HOUR, now))
    assert not any(acted_on(*photographs))


@pytest.mark.parametrize('ahead', [-7200.0, -100.0, 60.0, 7200.0, -YEAR, 12 * YEAR, NEVER_SET])
def test_a_camera_with_a_wrong_clock_is_trusted_after_a_few_photographs(ahead: float) -> None:
    learning = [False] * (LEARNING_PHOTOGRAPHS - 1)
    assert acted_on(*live(9, ahead=ahead)) == [*learning, *[True] * 6]


@pytest.mark.parametrize('ahead', [-14.0, 14.0])
def test_a_clock_that_is_nearly_right_is_trusted_at_once(ahead: float) -> None:
    assert all(acted_on(*live(9, ahead=ahead)))


@pytest.mark.parametrize('stamp', [-NOW, -NOW + 5000.0, 1e9 - NOW, 12 * YEAR, 100.0, -500.0])
def test_one_wrong_stamp_costs_one_photograph(stamp: float) -> None:
    before, after = live(10), live(10, after=330.0)
    assert acted_on(*before, (stamp, 303.0), *after) == [True] * 10 + [False] + [True] * 10
    assert acted_on((stamp, -28.0), *before) == [False] + [True] * 10


def test_every_doubt_is_one_clear_line() -> None:
    wrong = [(-NOW + 5.0, 303.0), (12 * YEAR, 333.0), (240.0, 363.0)]
    lines = doubts((-NOW, 0.0), *live(10), *wrong)
    assert lines[0] == 'its stamp is 0 s, no time since 1970; set the clock of the camera'
    assert lines[11].endswith('days, 8:04:25 (h:mm:ss) before the last photograph')
    assert lines[12].startswith('its stamp lies 4379 days, ')
    assert lines[12].endswith('in the future; set the clock of the camera')
    assert lines[13] == 'its stamp has come before, so the photograph is an old one'


@pytest.mark.parametrize('step', [-3600.0, 3600.0, -7.0, 7.0])
def test_a_clock_set_in_between_is_trusted_after_a_few_photographs(step: float) -> None:
    acted = acted_on(*live(5), *live(9, after=150.0, ahead=step + 0.5))
    assert acted[:5] == [True] * 5
    assert acted[8:] == [True] * 6


def test_a_camera_whose_clock_is_ahead_is_trusted_and_its_old_photographs_are_not() -> None:
    again = [(7200.0 + 30.0 * n, 3605.0 + n) for n in range(50)]
    assert acted_on(*live(121, ahead=7200.0), *again)[3:] == [True] * 118 + [False] * 50


def test_photographs_that_lag_more_and_more_become_late_at_a_live_pace() -> None:
    lagging = [(30.0 * n, 36.0 * n) for n in range(20)]
    assert acted_on(*lagging) == [True] * 8 + [False] * 12


@pytest.mark.parametrize('late', [2.0, 20.0, 40.0, 50.0, 70.0, 80.0, 100.0])
def test_a_setpoint_holds_until_the_next_one_comes(late: float) -> None:
    photographs = [(INTERVAL * n - late, INTERVAL * n) for n in range(40)]
    clock = PhotographClock(interval=INTERVAL, validity=VALIDITY)
    judged = [clock.judge(NOW + stamp, NOW + arrival) for stamp, arrival in photographs]
    fresh = [one for one in judged if not one.doubt and one.age <= clock.most_age]
    assert len(fresh) > 35  # a clock that is behind is learnt
    assert all(one.age + INTERVAL < VALIDITY for one in fresh)


def test_photographs_that_stay_late_are_never_acted_on_by_a_clock_that_was_right() -> None:
    delayed = [(150.0 + 30.0 * n, 600.0 + 30.0 * n) for n in range(40)]
    assert not any(acted_on(*live(5), *delayed)[5:])


def test_a_backlog_sent_a_little_faster_than_it_was_taken_is_not_acted_on() -> None:
    slow = [(30.0 * n - HOUR, 28.5 * n) for n in range(60)]
    assert not any(acted_on(*slow))


def test_a_clock_that_drifts_keeps_control() -> None:
    days = 10 * 2880
    slow, fast = (
        [(30.0 * n * (1.0 + drift) - HOUR, 30.0 * n + 2.0) for n in range(days)]
        for drift in (-5e-5, 5e-5)
    )
    assert all(acted_on(*slow)[LEARNING_PHOTOGRAPHS:])
    assert all(acted_on(*fast)[LEARNING_PHOTOGRAPHS:])


# --- no setpoint ever follows from an old photograph ---------------------------------------------


@dataclass(frozen=True)
class Stretch:
    """The fate of `count` photographs: its `kind`, and the `pause` [s] after some of them."""

    kind: str
    count: int
    pause: float
    every: int


STRETCHES = st.lists(
    st.builds(
        Stretch,
        kind=st.sampled_from(['live', 'held back', 'lost', 'sent again']),
        count=st.integers(1, 12),
        pause=st.sampled_from([0.0, 1.0, 10.0, 29.0, 30.0, 31.0, 60.0, 300.0]),
        every=st.integers(2, 7),
    ),
    max_size=8,
)


def course(stretches: list[Stretch], latency: float) -> list[tuple[float, float]]:
    """Return (exposure, arrival) [s] of all photographs that arrive, in the order of arrival.

    Photographs that are held back come in a burst with pauses; a folder that is sent again comes
    with pauses, too, and the camera goes on meanwhile.
    """
    exposed, arrived, now = 0, [], 0.0
    for stretch in stretches:
        burst: list[float] = []
        if stretch.kind == 'sent again':
            burst = [moment for moment, _ in arrived][: 5 * stretch.count]
        for _ in range(stretch.count if stretch.kind != 'sent again' else 0):
            taken = INTERVAL * exposed
            exposed += 1
            now = max(now, taken + latency)
            if stretch.kind == 'live':
                arrived.append((taken, now))
            elif stretch.kind == 'held back':
                burst.append(taken)
        for number, taken in enumerate(burst):
            now += stretch.pause if number % stretch.every == 1 else 0.2
            arrived.append((taken, now))
        exposed = max(exposed, int(now // INTERVAL) + 1)
    return arrived


def ages_acted_on(arrivals: list[tuple[float, float]], *, ahead: float) -> list[float]:
    acted = acted_on(*[(taken + ahead, arrival) for taken, arrival in arrivals])
    return [arrival - taken for (taken, arrival), used in zip(arrivals, acted, strict=True) if used]


@given(
    stretches=STRETCHES,
    ahead=st.floats(-AGREEMENT * INTERVAL, AGREEMENT * INTERVAL),
    latency=st.floats(0.0, 15.0),
)
def test_by_a_clock_that_is_nearly_right_no_old_photograph_is_acted_on(
    stretches: list[Stretch], ahead: float, latency: float
) -> None:
    ages = ages_acted_on(course(stretches, latency), ahead=ahead)
    assert max(ages, default=0.0) <= VALIDITY


@given(stretches=STRETCHES, ahead=st.floats(-1e8, 1e8), latency=st.floats(0.0, 15.0))
def test_by_any_clock_that_was_learnt_no_old_photograph_is_acted_on(
    stretches: list[Stretch], ahead: float, latency: float
) -> None:
    first = Stretch('live', LEARNING_PHOTOGRAPHS, 0.0, 2)
    arrivals = course([first, *stretches], latency)
    assert max(ages_acted_on(arrivals, ahead=ahead), default=0.0) <= VALIDITY


@given(
    ahead=st.floats(-2e9, 1e9),
    delays=st.lists(st.floats(1.0, 1.0 + 0.2 * INTERVAL), min_size=12, max_size=12),
)
def test_a_live_camera_with_a_constant_error_gets_setpoints_within_a_few_photographs(
    ahead: float, delays: list[float]
) -> None:
    photographs = [(INTERVAL * n + ahead, INTERVAL * n + delay) for n, delay in enumerate(delays)]
    assume(sorted(delays[:4], reverse=True) != delays[:4])  # it might be a backlog
    assert all(acted_on(*photographs)[LEARNING_PHOTOGRAPHS - 1 :])
