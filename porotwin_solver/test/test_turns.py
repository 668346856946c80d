"""Tests of the turns of requests: one works, a few wait, a client cancels its own."""

import threading

import pytest

from porotwin_solver.service.turns import BusyError, CancelledError, Turns

PATIENCE = 60.0
"""Longest wait for another thread [s]."""


def test_a_request_that_works_is_cancelled_at_its_next_check() -> None:
    turns = Turns(2)
    with pytest.raises(CancelledError), turns.turn(token='mine'):
        turns.check()
        assert turns.cancel('mine') == 1
        turns.check()
    with turns.turn():
        turns.check()


def test_a_request_that_waits_for_a_cancelled_one_never_begins() -> None:
    turns, ended, begun = Turns(2), [], []

    def wait() -> None:
        try:
            with turns.turn(token='mine'):
                begun.append(True)
        except CancelledError as error:
            ended.append(str(error))

    waiting = threading.Thread(target=wait)
    with turns.turn(token='mine'):
        waiting.start()
        cancelled = 1
        while cancelled == 1:
            cancelled = turns.cancel('mine')
    waiting.join(PATIENCE)
    assert (cancelled, ended, begun) == (2, ['cancelled'], [])


def test_more_requests_than_may_wait_are_refused() -> None:
    turns = Turns(0)
    with turns.turn(), pytest.raises(BusyError, match='busy: 1 requests'), turns.turn():
        pass


def test_a_request_that_nobody_waits_for_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('porotwin_solver.service.turns.HEARTBEAT_S', 0.0)
    turns = Turns(1)
    with pytest.raises(CancelledError, match='nobody waits'), turns.turn(lambda: True):
        turns.check()


def test_nothing_is_here_to_be_cancelled() -> None:
    assert Turns(1).cancel('mine') == 0


@pytest.mark.parametrize(('own', 'foreign'), [('mine', 'yours'), ('mine', ''), ('', '')])
def test_a_stranger_cancels_nothing(own: str, foreign: str) -> None:
    turns = Turns(1)
    with turns.turn(token=own):
        assert turns.cancel(foreign) == 0
        turns.check()
