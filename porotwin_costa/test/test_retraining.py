"""When a training is due, and when it is lost."""

import pytest

from porotwin_costa.training.retraining import RETRY_S, SILENCE_S, Retraining


def _running(now: float = 0.0) -> Retraining:
    retraining = Retraining(1)
    retraining.pair_added()
    retraining.started(now)
    return retraining


def test_a_training_is_wanted_after_every_so_many_pairs():
    retraining = Retraining(3)
    assert [retraining.pair_added() for _ in range(6)] == [False, False, True, False, False, True]
    assert retraining.wanted(1e6)


def test_pairs_on_disk_count():
    retraining = Retraining(40, known_pairs=38)
    assert not retraining.wanted(1e6)
    assert [retraining.pair_added() for _ in range(2)] == [False, True]
    assert retraining.wanted(1e6)


def test_one_training_runs_at_a_time():
    retraining = _running()
    assert not retraining.wanted(1e6)
    retraining.pair_added()
    assert not retraining.wanted(1e6)
    retraining.finished()
    assert retraining.wanted(1e6)


def test_a_refused_goal_is_sent_again():
    retraining = _running()
    retraining.refused(10.0)
    assert not retraining.wanted(10.0)
    assert retraining.wanted(10.0 + RETRY_S)


def test_a_training_is_lost_with_its_node():
    retraining = _running(now=10.0)
    assert not retraining.lost(11.0, server_ready=True)
    assert retraining.lost(12.0, server_ready=False)
    assert retraining.wanted(1e6)
    assert not retraining.lost(13.0, server_ready=False)


@pytest.mark.parametrize('reported', [10.0, 100.0])
def test_a_training_that_reports_nothing_is_lost(reported):
    retraining = _running(now=10.0)
    retraining.reported(reported)
    assert not retraining.lost(reported + SILENCE_S, server_ready=True)
    assert retraining.lost(reported + SILENCE_S + 1.0, server_ready=True)
    assert retraining.wanted(1e6)
