"""Tests of the effects of a replay: own messages do not count, and a run begins anew."""

from porotwin_solver.service.replayed_effects import ReplayedEffects


def test_an_own_message_is_known_once() -> None:
    replay = ReplayedEffects()
    replay.tell('leak')
    assert not replay.is_own('decay')
    assert replay.is_own('leak')
    assert not replay.is_own('leak')  # the replay decides the same again


def test_own_messages_before_a_later_one_are_lost() -> None:
    replay = ReplayedEffects()
    for text in ('leak', 'decay', 'rate'):
        replay.tell(text)
    assert replay.is_own('decay')
    assert not replay.is_own('leak')
    assert replay.is_own('rate')


def test_a_run_begins_anew_when_the_time_goes_back() -> None:
    replay = ReplayedEffects()
    assert not replay.begins_anew(clock=100, published=1)
    replay.decide(2)
    assert not replay.begins_anew(clock=200, published=3)
    assert not replay.begins_anew(clock=200, published=4)
    assert replay.begins_anew(clock=100, published=5)


def test_effects_that_overtake_the_clock_belong_to_the_new_run() -> None:
    replay = ReplayedEffects()
    assert not replay.begins_anew(clock=200, published=1)
    replay.decide(3)
    assert not replay.begins_anew(clock=100, published=2)


def test_another_replay_may_begin_earlier() -> None:
    replay = ReplayedEffects()
    replay.tell('leak')
    assert not replay.begins_anew(clock=200, published=1)
    replay.forget()
    assert not replay.is_own('leak')
    assert not replay.begins_anew(clock=100, published=2)
