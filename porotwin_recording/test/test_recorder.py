"""Tests of the recorder: losses are counted, and recording survives a full disk."""

import resource
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from patience import until
from recording_examples import STRING

from porotwin_core.basis.errors import InputError
from porotwin_recording.live.recorder import LossCounter, Recorder
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import TopicQos


@given(st.sets(st.integers(2, 199)))
def test_every_gap_in_the_numbers_is_a_loss(lost: set[int]) -> None:
    counter = LossCounter()
    for sequence in range(1, 201):
        if sequence not in lost:
            counter.observe('/t', sequence, single_publisher=True)
    assert counter.total == len(lost)


def test_a_restarted_publisher_is_no_loss() -> None:
    counter = LossCounter()
    for sequence in (5, 6, 7, 1, 2):
        counter.observe('/t', sequence, single_publisher=True)
    assert counter.total == 0


def test_numbers_of_several_publishers_are_not_compared() -> None:
    counter = LossCounter()
    for sequence, single in ((1, True), (9, False), (2, False), (3, True), (4, True)):
        counter.observe('/t', sequence, single_publisher=single)
    counter.observe('/uncounted', 0, single_publisher=True)
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


def test_messages_are_flushed_every_second(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / 'run.mcap', say=str)
    recorder.add_topic('/t', STRING, TopicQos())
    recorder.record('/t', b'one', log_time=1, publish_time=1)
    until(lambda: BagReader(tmp_path / 'run.mcap').message_count == 1)
    recorder.stop()


class Counting:
    """Records messages whose log times count them."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self.number = -1

    def record_one(self) -> bool:
        self.number += 1
        self.recorder.record('/t', bytes(10_000), log_time=self.number, publish_time=0)
        return True


def test_recording_continues_after_a_full_disk(tmp_path: Path) -> None:
    said: list[str] = []
    recorder = Recorder(
        tmp_path / 'run.mcap',
        compress=False,
        say=said.append,
        warn=said.append,
        backlog_limit=500_000,
    )
    recorder.add_topic('/t', STRING, TopicQos())
    counting = Counting(recorder)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        # the kernel lets no file of this process grow beyond this limit
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, hard))
        until(lambda: counting.record_one() and bool(said))
        assert 'the disk refuses data' in said[0]
        while recorder.dropped == 0:
            counting.record_one()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    until(lambda: any('recording continues' in text for text in said[1:]))
    counting.record_one()
    recorder.stop()
    bag = BagReader(tmp_path / 'run.mcap')
    numbers = [message.log_time for message in bag.messages()]
    assert bag.remarks == []
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == counting.number
    assert counting.number + 1 - len(numbers) == recorder.dropped
    assert said[-1].endswith(f'{len(numbers)} messages recorded, {recorder.dropped} lost')


def test_on_a_disk_that_stays_full_the_counts_are_the_readable_ones(tmp_path: Path) -> None:
    said: list[str] = []
    path = tmp_path / 'run.mcap'
    recorder = Recorder(path, compress=False, say=said.append, warn=said.append)
    recorder.add_topic('/t', STRING, TopicQos())
    counting = Counting(recorder)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, hard))
        until(lambda: counting.record_one() and recorder.disk_refuses)
        recorder.stop()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    bag = BagReader(path)
    found = len(list(bag.messages()))
    assert found == bag.message_count == recorder.message_count
    assert recorder.dropped == counting.number + 1 - found > 0
    assert recorder.failed
    assert f'the end could not be written (File too large); {found} messages remain' in said[-2]
    assert said[-1] == f'{path}: {found} messages recorded, {recorder.dropped} lost'


def test_a_bag_that_is_removed_while_it_is_recorded_comes_back(tmp_path: Path) -> None:
    said: list[str] = []
    recorder = Recorder(tmp_path / 'run', say=str, warn=said.append)
    recorder.add_topic('/t', STRING, TopicQos())
    recorder.record('/t', b'one', log_time=1, publish_time=1)
    until(lambda: recorder.message_count == 1)
    shutil.rmtree(tmp_path / 'run')
    recorder.record('/t', b'two', log_time=2, publish_time=2)
    until(lambda: recorder.message_count == 2)
    shutil.rmtree(tmp_path / 'run')
    recorder.stop()
    assert not recorder.failed
    bag = BagReader(tmp_path / 'run')
    assert [message.data for message in bag.messages()] == [b'one', b'two']
    assert 'was removed and is written again' in said[0]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match='cannot be written'):
        Recorder(tmp_path / 'file' / 'run')


def test_a_bag_that_exists_is_refused(tmp_path: Path) -> None:
    Recorder(tmp_path / 'run', say=str).stop()
    with pytest.raises(InputError, match='exists already'):
        Recorder(tmp_path / 'run')
