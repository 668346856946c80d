"""Tests of the replay clock."""

from porotwin_recording.live.replay_clock import ReplayClock
from porotwin_recording.mcap.serialization import SECOND


def test_a_rate_divides_the_waiting_time() -> None:
    clock = ReplayClock(100.0)
    clock.set(5 * SECOND)
    # 3600 s of the bag take 36 s of wall time, less the time since `set`
    assert 30 < clock.wait_for(3605 * SECOND) <= 36
    assert clock.now() >= 5 * SECOND


def test_past_moments_need_no_waiting() -> None:
    clock = ReplayClock(100.0)
    clock.set(5 * SECOND)
    assert clock.wait_for(4 * SECOND) == 0


def test_with_a_rate_of_0_nothing_is_waited_for() -> None:
    assert ReplayClock(0.0).wait_for(10**18) == 0
