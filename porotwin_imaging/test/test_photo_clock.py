"""The clock policy: which time a photograph gets."""

import math
import random
from itertools import pairwise

import pytest

from porotwin_imaging.photograph.photo_clock import (
    EARLIEST_S,
    OLD_INTERVALS,
    START_IS_WRONG,
    ClockMemory,
    Stamp,
    TimeEvidence,
    believable,
    own_time,
    stamps,
)

NOW = 1.8e9
"""Time of the first arrival [s since 1970]."""
INTERVAL = 30.0
HOUR = 3600.0


def times(evidence: list[TimeEvidence], batch: int = 1, **options) -> list[float | None]:
    """Return the stamps of photographs that become ready `batch` at a time."""
    return [stamp.time for stamp in found(evidence, batch, **options)]


def found(
    evidence: list[TimeEvidence], batch: int = 1, memory: ClockMemory | None = None, **options
) -> list[Stamp]:
    memory = memory or ClockMemory()
    result = []
    for start in range(0, len(evidence), batch):
        some, memory = stamps(
            evidence[start : start + batch], memory, interval_s=INTERVAL, **options
        )
        result += some
    return result


def live(number: int, **known) -> TimeEvidence:
    """Return photograph `number` of a camera that writes one per interval."""
    arrival = NOW + number * INTERVAL
    return TimeEvidence(f'{number}.jpg', arrival, **{'file': arrival - 0.5, **known})


def backlog(number: int, of: int = 20, **known) -> TimeEvidence:
    """Return photograph `number` that was in the folder before the start."""
    return TimeEvidence(f'{number}.jpg', NOW, watched=False, waiting=of - 1 - number, **known)


def test_the_camera_is_believed_before_the_file() -> None:
    assert times([live(0, exif=NOW - 2.25)]) == [NOW - 2.25]
    assert times([live(0, exif=NOW - 2.25)], trust='file') == [NOW - 0.5]
    assert times([live(0, exif=NOW - 2.25)], trust='arrival') == [NOW]
    assert times([live(0)]) == [NOW - 0.5]
    assert times([TimeEvidence('0.jpg', NOW)]) == [NOW]


@pytest.mark.parametrize(
    'wrong', [0.0, 1e9, EARLIEST_S - 1, NOW + HOUR, 2.1e9, 1e12, math.nan, math.inf, -1e9]
)
def test_an_impossible_file_time_is_replaced_by_the_arrival_and_said_once(wrong: float) -> None:
    result = found([live(0), live(1, file=wrong), live(2, file=wrong), live(3)])
    assert [stamp.time for stamp in result] == [
        NOW - 0.5,
        NOW + INTERVAL,
        NOW + 2 * INTERVAL,
        NOW + 3 * INTERVAL - 0.5,
    ]
    assert [len(stamp.remarks) for stamp in result] == [0, 1, 0, 0]
    assert "of '1.jpg' is not believed" in result[1].remarks[0]


@pytest.mark.parametrize('wrong', [0.0, 1e9, NOW + HOUR, 2.1e9])
def test_an_impossible_exif_time_is_replaced_by_the_file_time(wrong: float) -> None:
    assert times([live(0, exif=wrong)]) == [NOW - 0.5]


def test_photographs_that_were_there_before_keep_their_own_times() -> None:
    own = [NOW - HOUR + n * INTERVAL for n in range(20)]
    assert times([backlog(n, file=own[n]) for n in range(20)], batch=4) == own
    assert times([backlog(n, exif=own[n], file=NOW - 1) for n in range(20)], batch=4) == own


@pytest.mark.parametrize('batch', [1, 4])
def test_a_copied_folder_gets_times_that_nobody_acts_on(batch: int) -> None:
    # all files have the time of the copy, just before the start
    result = times([backlog(n, file=NOW - 5 + 0.01 * n) for n in range(20)], batch=4)
    assert all(time is not None and time <= NOW - OLD_INTERVALS * INTERVAL for time in result)
    assert all(b > a for a, b in pairwise(result))


def test_a_file_without_a_time_in_a_backlog_is_old_or_left_out() -> None:
    own = [NOW - HOUR + n * INTERVAL for n in range(4)]
    evidence = [backlog(n, 4, file=own[n]) for n in range(4)]
    evidence[2] = backlog(2, 4, file=0.0)
    result = times(evidence)
    assert result == [own[0], own[1], own[1] + INTERVAL / 2, own[3]]
    recent = [backlog(0, 2, file=NOW - 20.0), backlog(1, 2, file=0.0)]
    assert times(recent) == [NOW - 20.0, None]


def test_a_folder_copied_while_the_camera_is_watched_is_old() -> None:
    arrival = NOW + 100.0
    copied = [
        TimeEvidence(f'{n}.jpg', arrival, file=arrival - 0.01 * n, waiting=11 - n)
        for n in range(12)
    ]
    result = times(copied, batch=4)
    assert all(time is not None and time <= arrival - 300.0 for time in result)
    # between the photographs of a running camera, they are left out
    running = found([live(n) for n in range(4)])
    memory = ClockMemory(last=running[-1].time)
    assert set(times(copied, batch=4, memory=memory)) == {None}


def test_the_protocol_orders_a_backlog_and_says_nothing_of_a_live_photograph() -> None:
    evidence = [backlog(n, 3, file=NOW - n, protocol=30.0 * n, protocol_end=60.0) for n in range(3)]
    latest = NOW - OLD_INTERVALS * INTERVAL
    assert times(evidence, batch=3) == [latest - 60.0, latest - 30.0, latest]
    assert times([live(0, protocol=90.0, protocol_end=90.0)]) == [NOW - 0.5]
    assert times([live(0, protocol=NOW - 1.0)]) == [NOW - 1.0]


def test_a_clock_an_hour_behind_is_corrected_when_three_fresh_photographs_agree() -> None:
    result = found([live(n, exif=NOW + n * INTERVAL - HOUR - 1.0) for n in range(6)])
    assert [stamp.time for stamp in result[:2]] == [NOW - HOUR - 1.0, NOW + INTERVAL - HOUR - 1.0]
    assert [stamp.time for stamp in result[2:]] == [NOW + n * INTERVAL for n in range(2, 6)]
    (line,) = [remark for stamp in result for remark in stamp.remarks]
    assert line.startswith("the camera's clock is 3601 s behind this computer's clock")
    assert line.endswith(START_IS_WRONG)


def test_the_lag_of_a_clock_that_was_never_set_is_told_in_days() -> None:
    years = 1638.0 * 24.0 * HOUR
    result = found([live(n, exif=NOW + n * INTERVAL - years) for n in range(4)])
    (line,) = [remark for stamp in result for remark in stamp.remarks if 'behind' in remark]
    assert '(1638.0 d) behind' in line
    assert START_IS_WRONG not in line, 'another experiment begins by itself'


def test_a_clock_an_hour_ahead_never_gives_a_time_in_the_future() -> None:
    evidence = [live(n, exif=NOW + n * INTERVAL + HOUR) for n in range(6)]
    result = times(evidence)
    assert all(abs(t - e.arrival) < 1.0 for t, e in zip(result, evidence, strict=True))


def test_old_photographs_that_are_copied_at_the_pace_of_a_camera_stay_old() -> None:
    # with their own file times: the file is not fresh
    old = [
        live(n, file=NOW - HOUR + n * INTERVAL, exif=NOW - HOUR + n * INTERVAL) for n in range(9)
    ]
    assert times(old) == [NOW - HOUR + n * INTERVAL for n in range(9)]
    # the burst after a network share was away
    late = [
        TimeEvidence(f'{n}.jpg', NOW + 0.5 * n, file=NOW + 0.5 * n, exif=NOW - 300 + 30 * n)
        for n in range(10)
    ]
    assert times(late) == [NOW - 300 + 30 * n for n in range(10)]


def test_a_camera_clock_that_is_set_during_the_experiment_is_followed_after_two_photographs() -> (
    None
):
    evidence = [live(n, exif=NOW + n * INTERVAL - (HOUR if n > 3 else 0)) for n in range(10)]
    result = times(evidence)
    assert result[:4] == [NOW + n * INTERVAL for n in range(4)]
    assert result[4:6] == [None, None]
    assert "the camera's clock was set back" in found(evidence)[4].remarks[0]
    assert result[6:] == [NOW + n * INTERVAL for n in range(6, 10)]
    # and back again
    again = [live(n, exif=NOW + n * INTERVAL - (HOUR if n < 4 else 0)) for n in range(10)]
    result = times(again)
    assert all(t is not None and t <= e.arrival for t, e in zip(result, again, strict=True))
    assert result[4:] == pytest.approx([NOW + n * INTERVAL for n in range(4, 10)], abs=1.0)


def test_equal_times_and_a_second_back_are_spread_and_older_ones_left_out() -> None:
    old = [live(n, exif=NOW - 60 + step) for n, step in enumerate([0, 0, -1, 30])]
    result = found([*old, live(4, exif=NOW - 61, file=NOW - 61)])
    first = NOW - 60
    assert [s.time for s in result[:4]] == pytest.approx(
        [first, first + 1e-3, first + 2e-3, first + 30]
    )
    assert result[4].time is None
    assert 'out of order' in result[4].remarks[0]


def test_a_baseline_may_be_older_than_the_photographs_before_it() -> None:
    evidence = [live(0, exif=NOW), live(1, exif=NOW - HOUR, in_sequence=False), live(2)]
    assert times(evidence) == [NOW, NOW - HOUR, NOW + 2 * INTERVAL - 0.5]


def test_when_this_computers_clock_is_set_back_times_begin_anew() -> None:
    evidence = [
        live(0),
        live(1),
        *(TimeEvidence('x.jpg', NOW - HOUR + 30 * n, file=NOW - HOUR + 30 * n) for n in range(3)),
    ]
    result = found(evidence)
    assert [s.time for s in result[2:]] == [NOW - HOUR + 30 * n for n in range(3)]
    assert result[2].remarks[0].startswith("this computer's clock was set back by")


def test_stamps_strictly_increase_and_never_lie_in_the_future() -> None:
    generator = random.Random(3)

    def some_time(arrival: float) -> float | None:
        return generator.choice(
            [None, 0.0, 1e9, 2.1e9, math.nan, arrival, arrival - generator.expovariate(0.01)]
        )

    for _ in range(200):
        arrival, memory, last = NOW, ClockMemory(), -math.inf
        for _ in range(30):
            arrival += generator.choice([0.0, 0.5, 30.0, 300.0])
            batch = [
                TimeEvidence(
                    'x.jpg', arrival, exif=some_time(arrival), file=some_time(arrival),
                    protocol=some_time(arrival), watched=generator.random() < 0.7,
                    waiting=generator.randrange(9),
                )
                for _ in range(generator.randrange(1, 5))
            ]  # fmt: skip
            result, memory = stamps(batch, memory, interval_s=INTERVAL)
            for stamp in result:
                if stamp.time is None:
                    assert stamp.remarks
                    continue
                assert believable(stamp.time, arrival + 1.0)
                assert stamp.time > last
                last = stamp.time


def test_the_own_time_orders_photographs_that_wait() -> None:
    assert own_time(live(0, exif=NOW - 5)) == NOW - 5
    assert own_time(live(0, exif=0.0)) == NOW - 0.5
    assert own_time(TimeEvidence('0.jpg', NOW, file=0.0)) is None
