"""Photographs wait until all subscribers are connected."""

import pytest

from porotwin_imaging.camera.subscriber_wait import LONGEST_WAIT_S, SubscriberWait


class SettableClock:
    """A clock that shows `now`."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> SettableClock:
    return SettableClock()


def test_photographs_wait_for_the_imaging_if_only_the_recorder_is_connected(clock) -> None:
    wait = SubscriberWait(2, clock=clock)
    assert not wait.is_over(connected=0, known=0)
    assert not wait.is_over(connected=1, known=1)
    clock.now = 3.0
    assert not wait.is_over(connected=1, known=2)
    assert wait.is_over(connected=2, known=2)


def test_an_incompatible_subscriber_does_not_stop_the_others(clock) -> None:
    wait = SubscriberWait(1, clock=clock)
    assert not wait.is_over(connected=1, known=2)
    clock.now = LONGEST_WAIT_S
    assert wait.is_over(connected=1, known=2)


def test_a_missing_subscriber_does_not_stop_the_others(clock) -> None:
    wait = SubscriberWait(2, clock=clock)
    assert not wait.is_over(connected=1, known=1)
    clock.now = LONGEST_WAIT_S
    assert wait.is_over(connected=1, known=1)
