"""Tests of the bag reader: messages come back, and faults of a bag are named."""

from pathlib import Path

import pytest
from bag_examples import SETPOINT, write_setpoints
from recording_examples import STRING

from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import TopicQos
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND


@pytest.mark.parametrize('compress', [True, False])
@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_messages_come_back_bit_for_bit(tmp_path: Path, name: str, compress: bool) -> None:
    written = write_setpoints(tmp_path / name, compress=compress)
    bag = BagReader(tmp_path / name)
    assert list(bag.messages()) == written
    assert bag.remarks == []
    assert (bag.start_time, bag.end_time) == (100 * SECOND, 119 * SECOND)
    assert bag.topics['/words'].message_count == 20
    assert bag.topics['/words'].qos.latched
    assert bag.topics['/porotwin/wells/setpoint'].qos == TopicQos(depth=1)


def test_messages_are_found_by_topic_and_time(tmp_path: Path) -> None:
    written = write_setpoints(tmp_path / 'run')
    found = BagReader(tmp_path / 'run').messages(['/words'], start=105 * SECOND, stop=108 * SECOND)
    assert list(found) == [
        message for message in written if message.topic == '/words' and 5 <= message.sequence < 8
    ]


def test_bags_of_rosbags_are_read(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / 'run', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection('/words', STRING, typestore=store)
        data = bytes(store.serialize_cdr(store.types[STRING](data='hello'), STRING))
        writer.write(topic, 5, data)
    bag = BagReader(tmp_path / 'run')
    (message,) = bag.messages()
    assert (message.log_time, bag.decode(message).data) == (5, 'hello')


def test_a_field_that_the_recorded_definition_lacks_has_its_default_value(tmp_path: Path) -> None:
    recorded_then = 'uint64 sequence\n'
    little_endian = b'\x00\x01\x00\x00'
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/old', SETPOINT, definition=recorded_then)
        bag.write('/old', little_endian + (3).to_bytes(8, 'little'), log_time=1)
    reader = BagReader(tmp_path / 'run')
    (message,) = (reader.decode(found) for found in reader.messages())
    assert message.sequence == 3
    assert message.reason == ''
    assert message.wells == []
    assert message.valid_until.sec == 0
    assert message.header.frame_id == ''
