"""Tests of a node's health: the last report holds, and work that is stuck shows."""

import pytest

from porotwin_core.ros.node_health import CALLBACK_PATIENCE_S, NodeHealth


class SetClock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def clock() -> SetClock:
    return SetClock()


def test_a_node_runs_before_it_reports(clock: SetClock) -> None:
    health = NodeHealth(clock).now()
    assert (health.level, health.message) == (0, 'running')


def test_the_last_report_is_repeated_with_its_age(clock: SetClock) -> None:
    health = NodeHealth(clock)
    health.report(1, 'state 3 done', {'cycle_duration_s': '0.8'})
    clock.time += 7.0
    health.callbacks_ran()
    now = health.now()
    assert (now.level, now.message) == (1, 'state 3 done')
    assert now.values == {'cycle_duration_s': '0.8', 'report_age_s': '7.0'}


def test_work_in_progress_shows_since_when(clock: SetClock) -> None:
    health = NodeHealth(clock)
    with health.busy('training'):
        clock.time += 5.0
        now = health.now()
    assert (now.level, now.values['busy_with'], now.values['busy_s']) == (0, 'training', '5.0')
    assert 'busy_with' not in health.now().values


def test_work_that_takes_longer_than_expected_is_an_error(clock: SetClock) -> None:
    health = NodeHealth(clock)
    health.report(0, 'state 3 done', {})
    with health.busy('state 4', longest_s=30.0):
        clock.time += 29.0
        health.callbacks_ran()
        assert health.now().level == 0
        clock.time += 2.0
        stuck = health.now()
    assert stuck.level == 2
    assert stuck.message == ('state 4: at work for 31 s, at most 30 s were expected; state 3 done')
    assert health.now().level == 0


def test_work_that_fails_is_no_longer_in_progress(clock: SetClock) -> None:
    health = NodeHealth(clock)
    with pytest.raises(ValueError, match='no such luck'), health.busy('state 4'):
        raise ValueError('no such luck')
    assert 'busy_with' not in health.now().values


def test_callbacks_that_wait_for_another_are_a_warning(clock: SetClock) -> None:
    health = NodeHealth(clock)
    clock.time += CALLBACK_PATIENCE_S + 1.0
    assert health.now().level == 1
    assert 'one of them is at work' in health.now().message
    health.callbacks_ran()
    assert health.now().level == 0
