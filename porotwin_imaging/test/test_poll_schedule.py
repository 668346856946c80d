"""The rhythm of polls, and the pauses while a camera is absent."""

from porotwin_imaging.camera.poll_schedule import LONGEST_PAUSE_S, PollSchedule


def test_polls_keep_their_rhythm_and_pauses_grow() -> None:
    now = 100.0
    schedule = PollSchedule(30.0, clock=lambda: now)
    assert schedule.is_due()
    now = 102.0  # the poll took two seconds
    schedule.polled(failed=False)
    assert not schedule.is_due()
    now = 130.0
    assert schedule.is_due()
    pauses = []
    for _ in range(10):
        schedule.polled(failed=True)
        began = now
        while not schedule.is_due():
            now += 0.5
        pauses.append(now - began)
    assert pauses[:4] == [1.0, 2.0, 4.0, 8.0]
    assert pauses[-1] == LONGEST_PAUSE_S
    schedule.polled(failed=False)
    schedule.polled(failed=True)
    now += 1.0
    assert schedule.is_due()


def test_a_photograph_that_arrives_is_looked_for_at_once() -> None:
    now = 100.0
    schedule = PollSchedule(30.0, clock=lambda: now)
    schedule.polled(failed=False, arriving=True)
    assert schedule.is_due()
    schedule.polled(failed=False)
    assert not schedule.is_due()
