"""Recording: losses are found, and a disk that is full for a while costs only what it must."""

import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.errors import InputError
from porotwin_recording.bag_reader import BagReader
from porotwin_recording.recorder import LossCounter, Recorder
from porotwin_recording.topic import TopicQos

STRING = 'std_msgs/msg/String'


def eventually(condition: Callable[[], bool], timeout: float = 20.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()


@given(st.sets(st.integers(2, 199)))
def test_every_gap_in_the_numbers_is_a_loss(lost: set[int]) -> None:
    counter = LossCounter()
    for sequence in range(1, 201):
        if sequence not in lost:
            counter.see('/t', sequence, alone=True)
    assert counter.total == len(lost)


def test_a_publisher_that_starts_anew_is_no_loss() -> None:
    counter = LossCounter()
    for sequence in (5, 6, 7, 1, 2):
        counter.see('/t', sequence, alone=True)
    assert counter.total == 0


def test_numbers_of_several_publishers_are_not_compared() -> None:
    counter = LossCounter()
    for sequence, alone in ((1, True), (9, False), (2, False), (3, True), (4, True)):
        counter.see('/t', sequence, alone=alone)
    counter.see('/uncounted', 0, alone=True)
    assert counter.total == 0


def test_everything_recorded_is_in_the_bag(tmp_path: Path) -> None:
    said: list[str] = []
    recorder = Recorder(tmp_path / 'run', say=said.append, warn=said.append)
    recorder.add_topic('/t', STRING, TopicQos(durability='transient_local'))
    for number in range(10_000):
        recorder.record(
            '/t', b'%d' % number, log_time=number, publish_time=number + 1, sequence=number + 1
        )
    recorder.stop()
    recorder.stop()
    bag = BagReader(tmp_path / 'run')
    found = [(m.data, m.log_time, m.publish_time, m.sequence) for m in bag.messages()]
    assert found == [(b'%d' % n, n, n + 1, n + 1) for n in range(10_000)]
    assert bag.topics['/t'].qos.latched
    assert said == [f'{tmp_path / "run"}: 10000 messages recorded, 0 lost']


def test_what_waits_is_flushed_every_second(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / 'run.mcap', say=str)
    recorder.add_topic('/t', STRING, TopicQos())
    recorder.record('/t', b'one', log_time=1, publish_time=1)
    assert eventually(lambda: BagReader(tmp_path / 'run.mcap').message_count == 1)
    recorder.stop()


def test_recording_outlasts_a_full_disk(tmp_path: Path) -> None:
    said: list[str] = []
    recorder = Recorder(
        tmp_path / 'run.mcap',
        compress=False,
        say=said.append,
        warn=said.append,
        backlog_limit=500_000,
    )
    recorder.add_topic('/t', STRING, TopicQos())
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        # the kernel refuses to let any file of this process grow beyond this, as a full disk would
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, hard))
        assert eventually(lambda: record_more(recorder) and bool(said))
        assert 'the disk refuses more' in said[0]
        while recorder.dropped == 0:
            record_more(recorder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert eventually(lambda: any('recording goes on' in text for text in said[1:]))
    record_more(recorder)
    recorder.stop()
    bag = BagReader(tmp_path / 'run.mcap')
    numbers = [message.log_time for message in bag.messages()]
    assert bag.remarks == []
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == recorder.number
    assert recorder.number + 1 - len(numbers) == recorder.dropped
    assert said[-1].endswith(f'{len(numbers)} messages recorded, {recorder.dropped} lost')


def record_more(recorder: Recorder) -> bool:
    """Record one message more than before."""
    recorder.number = getattr(recorder, 'number', -1) + 1
    recorder.record('/t', bytes(10_000), log_time=recorder.number, publish_time=0)
    return True


def test_a_bag_that_exists_is_refused(tmp_path: Path) -> None:
    Recorder(tmp_path / 'run', say=str).stop()
    with pytest.raises(InputError, match='exists already'):
        Recorder(tmp_path / 'run')
