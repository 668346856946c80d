"""Tests of the inbox: states, refreshed messages, interruptions and rates find each other."""

from collections.abc import Callable

import numpy as np
import pytest

from porotwin_core.clock.freshness import IN_TIME, StampJudgement
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_core.rates.wells import WellRate
from porotwin_hub.loop.inbox import WAITING_STATES, ArrivedState, Inbox, ReadyState

RATES = {'push': WellRate(1e-7)}
OTHER = {'push': WellRate(2e-7)}


class Clock:
    """A clock that tests set."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def inbox(clock: Clock) -> Inbox[str]:
    return Inbox(clock, judge=judge)


def judge(stamp: float, _: float) -> StampJudgement:
    """Doubt the stamps of a camera whose clock is wrong."""
    return StampJudgement(0.0, 'of the future') if stamp > 1e6 else IN_TIME


def state(sequence: int, stamp: float | None = None) -> ArrivedState[str]:
    """Return a state; photographs are 30 s apart."""
    stamp = 30.0 * sequence if stamp is None else stamp
    return ArrivedState(sequence, stamp, np.zeros((2, 3)), f'message {sequence}')


def add(inbox: Inbox[str], sequence: int, stamp: float | None = None) -> None:
    """Add a state and its refreshed message."""
    inbox.add_state(state(sequence, stamp))
    inbox.add_refreshed(sequence)


def taken(inbox: Inbox[str]) -> ReadyState[str]:
    ready = inbox.take(timeout=0.0)
    assert ready is not None
    return ready


def nothing(inbox: Inbox[str]) -> bool:
    return inbox.take(timeout=0.0) is None


@pytest.mark.parametrize('state_first', [True, False])
def test_a_state_is_ready_when_both_messages_are_here(
    inbox: Inbox[str], clock: Clock, state_first: bool
) -> None:
    steps: list[Callable[[], None]] = [
        lambda: inbox.add_state(state(3)),
        lambda: inbox.add_refreshed(3),
    ]
    first, second = steps if state_first else steps[::-1]
    first()
    assert nothing(inbox)
    clock.now = 1002.0
    second()
    ready = taken(inbox)
    assert (ready.state.sequence, ready.state.envelope) == (3, 'message 3')
    assert (ready.arrival, ready.skipped) == (1002.0, 0)
    assert nothing(inbox)


def test_a_state_that_is_never_refreshed_is_forgotten(inbox: Inbox[str]) -> None:
    for number in range(WAITING_STATES + 1):
        inbox.add_state(state(number))
    inbox.add_refreshed(0)
    assert nothing(inbox)
    inbox.add_refreshed(1)
    assert taken(inbox).state.sequence == 1


def test_a_refreshed_message_may_come_twice(inbox: Inbox[str]) -> None:
    inbox.add_refreshed(1)  # its state was refused, and the numbers began anew
    inbox.add_refreshed(1)
    inbox.add_state(state(1))
    assert taken(inbox).state.sequence == 1
    assert nothing(inbox)


def test_the_newest_state_is_taken_and_older_ones_are_counted(inbox: Inbox[str]) -> None:
    for number in (1, 2, 3):
        add(inbox, number)
    ready = taken(inbox)
    assert (ready.state.sequence, ready.skipped) == (3, 2)
    add(inbox, 4)
    assert taken(inbox).skipped == 0


def test_a_doubtful_stamp_leaves_no_trace(inbox: Inbox[str]) -> None:
    add(inbox, 1)
    taken(inbox)
    known = KnownRates(30.0, 60.0, RATES)
    inbox.add_rates(known)
    add(inbox, 2, 2e9)
    doubtful = taken(inbox)
    assert (doubtful.is_believed, doubtful.known) == (False, ())
    assert doubtful.doubts == ('the photograph at 2000000000.000 s is not used: of the future',)
    add(inbox, 3, 60.0)
    ready = taken(inbox)
    assert (ready.is_believed, ready.time_went_back, ready.known) == (True, False, (known,))


def test_the_newest_believed_state_is_taken_and_doubts_are_told(inbox: Inbox[str]) -> None:
    add(inbox, 1)
    add(inbox, 2)
    add(inbox, 3, 2e9)
    ready = taken(inbox)
    assert (ready.state.sequence, ready.skipped, len(ready.doubts)) == (2, 1, 1)
    assert nothing(inbox)


def test_in_simulated_time_no_state_is_left_out(clock: Clock) -> None:
    inbox: Inbox[str] = Inbox(clock)
    for number in range(WAITING_STATES + 3):
        add(inbox, number)
    ready = taken(inbox)
    assert (ready.state.sequence, ready.skipped) == (2, 2)
    assert [taken(inbox).state.sequence for _ in range(5)] == [3, 4, 5, 6, 7]


def test_interruptions_of_the_far_future_do_not_pile_up(inbox: Inbox[str]) -> None:
    for number in range(1000):
        inbox.add_interruption(2e9 + number, 'of the future')
    inbox.add_interruption(45.0, 'now')
    add(inbox, 2)
    assert taken(inbox).interruptions == ('now',)


def test_a_time_is_near_by_the_clock_of_the_camera_or_of_this_machine(clock: Clock) -> None:
    inbox: Inbox[str] = Inbox(clock, judge=judge, clock_tolerance=90.0)
    assert [inbox.is_near(time) for time in (950.0, 1100.0)] == [True, False]
    add(inbox, 1)
    taken(inbox)
    assert [inbox.is_near(time) for time in (50.0, 950.0, 500.0)] == [True, True, False]


def test_an_interruption_counts_by_its_stamp(inbox: Inbox[str]) -> None:
    add(inbox, 1)
    assert taken(inbox).interruptions == ()
    inbox.add_interruption(30.0, 'too late')
    inbox.add_interruption(70.0, 'of the future')
    inbox.add_interruption(45.0, 'in between')
    add(inbox, 2)
    assert taken(inbox).interruptions == ('in between',)
    add(inbox, 3)
    assert taken(inbox).interruptions == ('of the future',)
    add(inbox, 4)
    assert taken(inbox).interruptions == ()


def test_the_first_state_follows_every_earlier_interruption(inbox: Inbox[str]) -> None:
    inbox.add_interruption(0.0, 'start')
    add(inbox, 0)
    assert taken(inbox).interruptions == ('start',)


@pytest.mark.parametrize('told_at', [72.0, 60.0])  # simulated time stands at a photograph
def test_rates_belong_to_the_interval_of_their_stamps(inbox: Inbox[str], told_at: float) -> None:
    add(inbox, 1)
    taken(inbox)
    measured, confirmed = KnownRates(30.0, 60.0, RATES), KnownRates(told_at, told_at, OTHER)
    inbox.add_rates(confirmed)
    inbox.add_rates(measured)
    add(inbox, 2)
    assert taken(inbox).known == (measured,)
    add(inbox, 3)
    assert taken(inbox).known == (confirmed,)
    add(inbox, 4)
    assert taken(inbox).known == ()


def test_rates_of_skipped_states_are_kept(inbox: Inbox[str]) -> None:
    add(inbox, 1)
    taken(inbox)
    first, second = KnownRates(30.0, 60.0, RATES), KnownRates(60.0, 90.0, OTHER)
    inbox.add_rates(first)
    inbox.add_rates(second)
    add(inbox, 2)
    add(inbox, 3)
    assert taken(inbox).known == (first, second)


def test_rates_measured_across_a_state_belong_to_both_intervals(inbox: Inbox[str]) -> None:
    add(inbox, 1)
    taken(inbox)
    long = KnownRates(30.0, 90.0, RATES)
    inbox.add_rates(long)
    add(inbox, 2)
    assert taken(inbox).known == (long,)
    add(inbox, 3)
    assert taken(inbox).known == (long,)
    add(inbox, 4)
    assert taken(inbox).known == ()


def test_a_confirmation_that_comes_while_a_state_is_worked_on_belongs_to_the_next_one(
    inbox: Inbox[str],
) -> None:
    add(inbox, 1)
    taken(inbox)  # the photograph of 30 s; its setpoint follows a moment later
    confirmed, measured = KnownRates(31.0, 31.0, OTHER), KnownRates(30.0, 45.0, RATES)
    inbox.add_rates(confirmed)
    inbox.add_rates(measured)
    add(inbox, 2)
    assert taken(inbox).known == (confirmed, measured)
    add(inbox, 3)
    assert taken(inbox).known == ()


@pytest.mark.parametrize('stamp', [1.8e9, 60.0 + 91.0, 30.0 - 91.0])
def test_rates_by_a_clock_of_their_own_count_from_the_last_state_on(
    clock: Clock, stamp: float
) -> None:
    inbox: Inbox[str] = Inbox(clock, clock_tolerance=90.0)
    add(inbox, 1)
    taken(inbox)
    inbox.add_rates(KnownRates(stamp, stamp, RATES))
    add(inbox, 2)
    assert taken(inbox).known == (KnownRates(30.0, 30.0, RATES),)
    add(inbox, 3)
    assert taken(inbox).known == ()


def test_after_time_went_back_nothing_of_the_old_course_counts(inbox: Inbox[str]) -> None:
    add(inbox, 1, 3600.0)
    assert not taken(inbox).time_went_back
    inbox.add_rates(KnownRates(3610.0, 3610.0, OTHER))
    inbox.add_rates(KnownRates(-5.0, -5.0, RATES))
    inbox.add_interruption(0.0, 'a new start')
    add(inbox, 2, 0.0)
    ready = taken(inbox)
    assert ready.time_went_back
    assert ready.interruptions == ('a new start',)
    assert [item.rates for item in ready.known] == [RATES]
    add(inbox, 3, 30.0)
    again = taken(inbox)
    assert (again.time_went_back, again.known) == (False, ())


def test_a_repeated_stamp_counts_as_time_that_went_back(inbox: Inbox[str]) -> None:
    add(inbox, 1, 30.0)
    taken(inbox)
    add(inbox, 2, 30.0)
    assert taken(inbox).time_went_back
