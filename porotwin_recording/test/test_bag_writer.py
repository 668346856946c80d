"""Tests of the bag writer: other libraries read its bags, and nothing is overwritten."""

import errno
import io
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from bag_examples import SETPOINT, write_setpoints
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recording_examples import STRING
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from porotwin_core.basis.errors import InputError
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter, SplitRule, next_free_path
from porotwin_recording.mcap.definitions import message_definition, type_hash
from porotwin_recording.mcap.serialization import SECOND


@pytest.mark.parametrize('compress', [True, False])
def test_rosbags_reads_our_bags(tmp_path: Path, compress: bool) -> None:
    written = write_setpoints(tmp_path / 'run', compress=compress)
    with AnyReader([tmp_path / 'run']) as reader:
        found = list(reader.messages())
        assert [(c.topic, t, bytes(data)) for c, t, data in found] == [
            (m.topic, m.log_time, m.data) for m in written
        ]
        last = [data for c, _, data in found if c.msgtype == SETPOINT][-1]
        message = reader.deserialize(last, SETPOINT)
        assert message.wells[0].well == 'injector'
        assert message.reason == 'cycle 19: plume, Größe'
    with Reader(tmp_path / 'run') as plain:
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in plain.connections}
        assert qos['/words'].durability.name == 'TRANSIENT_LOCAL'
        assert qos['/porotwin/wells/setpoint'].depth == 1
        digests = {c.msgtype: c.digest for c in plain.connections}
        assert digests[SETPOINT] == type_hash(SETPOINT, message_definition(SETPOINT))
    with Reader(tmp_path / 'run' / 'run_0.mcap') as file:
        assert file.message_count == 40


@pytest.mark.parametrize('compress', [True, False])
def test_mcap_reads_our_bags(tmp_path: Path, compress: bool) -> None:
    written = write_setpoints(tmp_path / 'run.mcap', compress=compress)
    with (tmp_path / 'run.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        assert header.profile == 'ros2'
        found = list(reader.iter_decoded_messages())
    assert [(c.topic, m.log_time, m.publish_time, m.sequence, m.data) for _, c, m, _ in found] == [
        (m.topic, m.log_time, m.publish_time, m.sequence, m.data) for m in written
    ]
    assert found[-2].decoded_message.wells[0].rate == 1.4e-7 / 20


def test_an_existing_bag_is_not_overwritten(tmp_path: Path) -> None:
    write_setpoints(tmp_path / 'run')
    with pytest.raises(InputError, match='exists already'):
        BagWriter(tmp_path / 'run')


def test_a_bag_that_goes_on_takes_the_next_next_free_path(tmp_path: Path) -> None:
    for name, expected in (
        ('run', ['run', 'run_2', 'run_3']),
        ('run.mcap', ['run.mcap', 'run_2.mcap', 'run_3.mcap']),
        ('of.today', ['of.today', 'of.today_2', 'of.today_3']),
    ):
        made = []
        for _ in expected:
            made.append(next_free_path(tmp_path / name))
            write_setpoints(made[-1], 1)
        assert made == [tmp_path / one for one in expected]


def test_a_topic_keeps_its_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/words', STRING)
        bag.add_topic('/words', STRING)
        with pytest.raises(InputError, match="carries 'std_msgs/msg/String'"):
            bag.add_topic('/words', SETPOINT)
        with pytest.raises(InputError, match="'nowhere_msgs/msg/Word' is not installed"):
            bag.add_topic('/other', 'nowhere_msgs/msg/Word')


def test_a_bag_is_split_by_size_and_by_time(tmp_path: Path) -> None:
    for name, split in (('sized', SplitRule(size_bytes=3000)), ('timed', SplitRule(duration_s=4))):
        with BagWriter(tmp_path / name, compress=False, split=split) as bag:
            for number in range(12):
                bag.add_topic(f'/words_{number // 6}', STRING)  # one begins in a later file
                bag.write(f'/words_{number // 6}', bytes([number]) * 1000, log_time=number * SECOND)
        files = sorted((tmp_path / name).glob('*.mcap'))
        assert [file.name for file in files] == [f'{name}_{n}.mcap' for n in range(len(files))]
        assert len(files) > 2
        reader = BagReader(tmp_path / name)
        assert reader.remarks == []
        assert [message.data[0] for message in reader.messages()] == list(range(12))
        # rosbag2's own metadata name the same files and numbers
        with AnyReader([tmp_path / name]) as other:
            assert other.message_count == 12
            assert set(other.topics) == {'/words_0', '/words_1'}


class FileOnFullDisk(io.FileIO):
    """A file on a disk that refuses everything after some more writes, once that is a number."""

    writes_left: int | None = None

    def write(self, data: memoryview) -> int:
        if FileOnFullDisk.writes_left is not None:
            if FileOnFullDisk.writes_left == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            FileOnFullDisk.writes_left -= 1
        return super().write(data)


@pytest.fixture
def full_disk() -> Iterator[type[FileOnFullDisk]]:
    yield FileOnFullDisk
    FileOnFullDisk.writes_left = None


# the messages, the begin of the next file, or the end of this one is refused
@pytest.mark.parametrize('writes', [0, 1, 2])
def test_a_disk_that_is_full_when_a_bag_is_split_loses_no_message(
    tmp_path: Path, full_disk: type[FileOnFullDisk], writes: int
) -> None:
    bag = BagWriter(
        tmp_path / 'run',
        compress=False,
        split=SplitRule(size_bytes=3000),
        open_file=lambda path: full_disk(path, 'x'),
    )
    bag.add_topic('/words', STRING)
    for number in range(12):
        if number == 6:
            full_disk.writes_left = writes
        if number in (6, 7):
            with pytest.raises(OSError, match='No space left'):
                bag.write('/words', bytes([number]) * 1000, log_time=number)
            continue
        full_disk.writes_left = None
        bag.write('/words', bytes([number]) * 1000, log_time=number)
    bag.close()
    reader = BagReader(tmp_path / 'run')
    assert [message.data[0] for message in reader.messages()] == list(range(12))
    assert reader.remarks == []
    files = {file.name for file in (tmp_path / 'run').glob('*.mcap')}
    assert files == {f'run_{number}.mcap' for number in range(len(files))}


def test_one_file_is_not_split(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='one file cannot be split'):
        BagWriter(tmp_path / 'bag.mcap', split=SplitRule(size_bytes=1))


def test_bags_in_one_folder_are_read_as_one(tmp_path: Path) -> None:
    for name, first in (('morning', 0), ('noon', 10)):
        with BagWriter(tmp_path / 'day' / name) as bag:
            bag.add_topic('/words', STRING)
            for number in range(3):
                bag.write('/words', bytes([first + number]), log_time=(first + number) * SECOND)
    reader = BagReader(tmp_path / 'day')
    assert [message.data[0] for message in reader.messages()] == [0, 1, 2, 10, 11, 12]
    assert reader.topics['/words'].message_count == 6
    assert '2 bags joined: morning, noon' in reader.remarks[0]
