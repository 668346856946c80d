"""Tests of the lock-step: which answers count, and which photographs have none."""

import math
import threading

import pytest
from builtin_interfaces.msg import Time

from porotwin_core.ros.conversions import header_at, time_from_msg
from porotwin_recording.live.replay_lock_step import LockStep
from porotwin_recording.mcap.serialization import SECOND

RUNNING = threading.Event()


def waits(step: LockStep, stamp: int) -> bool:
    """Return whether the photograph with `stamp` [ns] has no answer."""
    try:
        step.wait(stamp, 0.0, RUNNING)
    except TimeoutError:
        return True
    return False


def test_a_photograph_waits_for_its_own_answer() -> None:
    step = LockStep()
    for stamp in (0, 30 * SECOND):
        step.ask(stamp)
        assert waits(step, stamp)
        step.answer(stamp)
        assert not waits(step, stamp)


def test_after_time_went_back_earlier_answers_do_not_count() -> None:
    step = LockStep()
    for stamp in (4770 * SECOND, 4800 * SECOND):
        step.ask(stamp)
        step.answer(stamp)
    step.ask(0)
    assert waits(step, 0)
    step.answer(4800 * SECOND)  # once more, and late
    assert waits(step, 0)
    step.answer(0)
    assert not waits(step, 0)
    step.ask(30 * SECOND)
    assert waits(step, 30 * SECOND)


def test_a_node_that_rounds_a_stamp_answers_it() -> None:
    step = LockStep()
    for nanoseconds in range(123_456_000, 123_457_000, 7):
        stamp = 1_700_000_000 * SECOND + nanoseconds
        step.ask(stamp)
        taken = time_from_msg(Time(sec=1_700_000_000, nanosec=nanoseconds))
        rounded = header_at(taken).stamp
        step.answer(rounded.sec * SECOND + rounded.nanosec)
        assert not waits(step, stamp)


def test_a_refused_photograph_has_no_answer_until_time_goes_back() -> None:
    step = LockStep()
    step.ask(30 * SECOND)
    step.refuse(30.0, 'too dark')
    assert step.wait(30 * SECOND, 0.0, RUNNING) == 'too dark'
    with pytest.raises(ValueError, match='NaN'):
        step.refuse(math.nan, 'odd')
    step.begin_anew()
    step.ask(30 * SECOND)
    assert waits(step, 30 * SECOND)


def test_an_end_of_the_replay_ends_the_wait() -> None:
    stopping = threading.Event()
    stopping.set()
    assert LockStep().wait(0, 60.0, stopping) == ''
