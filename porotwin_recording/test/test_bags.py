"""Bags: what is written is read by us and by others, whole, cut off, or on a full disk."""

import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PointStamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from std_msgs.msg import String

from porotwin_core.errors import InputError
from porotwin_msgs.msg import RigDescription, Setpoint, WellRate
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.bag_writer import BagWriter, free_name
from porotwin_recording.definitions import message_definition, type_hash
from porotwin_recording.mcap_writer import CHUNK_SIZE
from porotwin_recording.serialization import Serializer
from porotwin_recording.topic import TopicQos

SECOND = 1_000_000_000
STRING = 'std_msgs/msg/String'
SETPOINT = 'porotwin_msgs/msg/Setpoint'


def setpoint(number: int) -> Setpoint:
    wells = [WellRate(well='injector', rate=1.4e-7 / (number + 1), concentration=1.0)]
    message = Setpoint(sequence=number, wells=wells, reason=f'cycle {number}: plume, Größe')
    message.header.stamp.sec = number
    return message


def write_bag(path: Path, count: int = 20, *, compress: bool = True) -> list[BagMessage]:
    """Write setpoints and words in turn; return what a reader should give back."""
    serializer = Serializer()
    written = []
    with BagWriter(path, compress=compress) as bag:
        bag.add_topic('/porotwin/wells/setpoint', SETPOINT, qos=TopicQos(depth=1))
        bag.add_topic('/words', STRING, qos=TopicQos(durability='transient_local'))
        for number in range(count):
            for topic, kind, message in (
                ('/porotwin/wells/setpoint', SETPOINT, setpoint(number)),
                ('/words', STRING, String(data='wort ' * number)),
            ):
                data = serializer.to_cdr(message)
                log_time = (100 + number) * SECOND
                bag.write(
                    topic, data, log_time=log_time, publish_time=log_time - 7, sequence=number
                )
                written.append(BagMessage(topic, kind, log_time, log_time - 7, number, data))
    return written


@pytest.mark.parametrize('compress', [True, False])
@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_messages_come_back_bit_for_bit(tmp_path: Path, name: str, compress: bool) -> None:
    written = write_bag(tmp_path / name, compress=compress)
    bag = BagReader(tmp_path / name)
    assert list(bag.messages()) == written
    assert bag.remarks == []
    assert (bag.start_time, bag.end_time) == (100 * SECOND, 119 * SECOND)
    assert bag.topics['/words'].message_count == 20
    assert bag.topics['/words'].qos.latched
    assert bag.topics['/porotwin/wells/setpoint'].qos == TopicQos(depth=1)


def test_messages_are_found_by_topic_and_time(tmp_path: Path) -> None:
    written = write_bag(tmp_path / 'run')
    found = BagReader(tmp_path / 'run').messages(['/words'], start=105 * SECOND, stop=108 * SECOND)
    assert list(found) == [
        message for message in written if message.topic == '/words' and 5 <= message.sequence < 8
    ]


@pytest.mark.parametrize('compress', [True, False])
def test_rosbags_reads_our_bags(tmp_path: Path, compress: bool) -> None:
    written = write_bag(tmp_path / 'run', compress=compress)
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
    written = write_bag(tmp_path / 'run.mcap', compress=compress)
    with (tmp_path / 'run.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        assert header.profile == 'ros2'
        found = list(reader.iter_decoded_messages())
    assert [(c.topic, m.log_time, m.publish_time, m.sequence, m.data) for _, c, m, _ in found] == [
        (m.topic, m.log_time, m.publish_time, m.sequence, m.data) for m in written
    ]
    assert found[-2].decoded_message.wells[0].rate == 1.4e-7 / 20


def test_we_read_what_rosbags_writes(tmp_path: Path) -> None:
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


def test_definitions_keep_their_comments(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run')
    definition = BagReader(tmp_path / 'run').topics['/porotwin/wells/setpoint'].definition
    assert '[m^3/s], positive injects' in definition
    assert 'MSG: builtin_interfaces/Time' in definition


@pytest.mark.parametrize('kind', [Setpoint, RigDescription, PointStamped])
def test_type_hashes_are_those_of_the_interface_generator(kind: type) -> None:
    package, name = kind.__module__.split('.')[0], kind.__name__
    installed = Path(sys.prefix, 'share', package, 'msg', f'{name}.json')
    if not installed.is_file():
        pytest.skip(f'{installed} is not where this ROS installation keeps it')
    hashes = json.loads(installed.read_text())['type_hashes']
    wanted = {entry['type_name']: entry['hash_string'] for entry in hashes}
    type_name = f'{package}/msg/{name}'
    assert type_hash(type_name, message_definition(type_name)) == wanted[type_name]


def test_our_bytes_are_those_of_rclpy() -> None:
    from rclpy.serialization import deserialize_message

    message = setpoint(3)
    assert deserialize_message(Serializer().to_cdr(message), Setpoint) == message


@pytest.mark.parametrize('compress', [True, False])
def test_a_bag_cut_at_any_byte_gives_every_whole_chunk(tmp_path: Path, compress: bool) -> None:
    serializer = Serializer()
    path = tmp_path / 'run.mcap'
    ends = []
    written = []
    with BagWriter(path, compress=compress) as bag:
        bag.add_topic('/words', STRING)
        for number in range(12):
            data = serializer.to_cdr(String(data=f'word {number}'))
            bag.write('/words', data, log_time=number)
            bag.flush()
            written.append(data)
            ends.append(path.stat().st_size)
    content = path.read_bytes()
    generator = random.Random(731)
    cuts = [*ends, *(end - 1 for end in ends), *generator.sample(range(8, len(content)), 40)]
    for cut in cuts:
        path.write_bytes(content[:cut])
        bag = BagReader(path)
        found = [message.data for message in bag.messages()]
        # The index behind a chunk may be cut while the chunk itself is whole.
        least = sum(end <= cut for end in ends)
        assert least <= len(found) <= least + 1
        assert found == written[: len(found)]
        assert bag.message_count == len(found)
        assert 'has no end' in bag.remarks[0]


def test_a_damaged_chunk_is_named(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run.mcap', compress=False)
    content = bytearray((tmp_path / 'run.mcap').read_bytes())
    content[content.index(b'injector')] ^= 1
    (tmp_path / 'run.mcap').write_bytes(content)
    with pytest.raises(InputError, match=r'run.mcap: damaged .*mcap recover'):
        list(BagReader(tmp_path / 'run.mcap').messages())


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [(b'', 'is empty'), (b'rosbag', 'not an MCAP file'), (b'\x89MCAP0\r\n', None)],
)
def test_files_that_are_no_bags_are_named(
    tmp_path: Path, content: bytes, complaint: str | None
) -> None:
    path = tmp_path / 'run.mcap'
    path.write_bytes(content)
    if complaint is None:
        assert list(BagReader(path).messages()) == []
        return
    with pytest.raises(InputError, match=complaint):
        BagReader(path)


def test_broken_metadata_is_named(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run')
    metadata = tmp_path / 'run' / 'metadata.yaml'
    whole = yaml.safe_load(metadata.read_text())
    metadata.write_text('nothing: here')
    with pytest.raises(InputError, match='not the metadata of a bag'):
        BagReader(tmp_path / 'run')
    whole['rosbag2_bagfile_information']['storage_identifier'] = 'sqlite3'
    metadata.write_text(yaml.safe_dump(whole))
    with pytest.raises(InputError, match='is a sqlite3 bag; convert it with'):
        BagReader(tmp_path / 'run')
    metadata.unlink()
    bag = BagReader(tmp_path / 'run')
    assert bag.message_count == 40
    assert bag.remarks == []


def test_an_existing_bag_is_not_overwritten(tmp_path: Path) -> None:
    write_bag(tmp_path / 'run')
    with pytest.raises(InputError, match='exists already'):
        BagWriter(tmp_path / 'run')


def test_a_bag_that_goes_on_takes_the_next_free_name(tmp_path: Path) -> None:
    for name, wanted in (
        ('run', ['run', 'run_2', 'run_3']),
        ('run.mcap', ['run.mcap', 'run_2.mcap', 'run_3.mcap']),
        ('of.today', ['of.today', 'of.today_2', 'of.today_3']),
    ):
        made = []
        for _ in wanted:
            made.append(free_name(tmp_path / name))
            write_bag(made[-1], 1)
        assert made == [tmp_path / one for one in wanted]


def test_a_topic_keeps_its_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/words', STRING)
        bag.add_topic('/words', STRING)
        with pytest.raises(InputError, match="carries 'std_msgs/msg/String'"):
            bag.add_topic('/words', SETPOINT)
        with pytest.raises(InputError, match="'nowhere_msgs/msg/Word' is not installed"):
            bag.add_topic('/other', 'nowhere_msgs/msg/Word')


KILLED = """
import sys, time
from porotwin_recording.bag_writer import BagWriter
from porotwin_recording.serialization import Serializer
from std_msgs.msg import String
serializer = Serializer()
with BagWriter(sys.argv[1]) as bag:
    bag.add_topic('/words', 'std_msgs/msg/String')
    number = 0
    while True:
        bag.write('/words', serializer.to_cdr(String(data=str(number) * 50)), log_time=number)
        number += 1
        if number % 100 == 0:
            bag.flush()
            print(number, flush=True)
"""


def test_a_killed_writer_loses_nothing_that_was_flushed(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, '-c', KILLED, str(tmp_path / 'run')], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for _ in range(20):
        flushed = int(process.stdout.readline())
    process.send_signal(signal.SIGKILL)
    rest = process.stdout.read().split()
    process.wait()
    flushed = int(rest[-1]) if rest else flushed
    bag = BagReader(tmp_path / 'run')
    found = [bag.decode(message).data for message in bag.messages()]
    assert len(found) >= flushed
    assert found == [str(number) * 50 for number in range(len(found))]


def test_a_full_disk_loses_nothing_and_leaves_no_debris(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'run.mcap'
    bag = BagWriter(path, compress=False)
    bag.add_topic('/words', STRING)
    serializer = Serializer()
    first = serializer.to_cdr(String(data='first'))
    bag.write('/words', first, log_time=1)
    bag.flush()
    size = path.stat().st_size

    class Full:
        """A file on a disk that takes ten bytes more."""

        def __init__(self, file: object) -> None:
            self.file = file
            self.left = 10

        def write(self, data: memoryview) -> int:
            if self.left == 0:
                raise OSError(28, os.strerror(28))
            self.left -= 10
            return self.file.write(data[:10])

        def __getattr__(self, name: str) -> object:
            return getattr(self.file, name)

    file = bag._mcap._file
    bag._mcap._file = Full(file)
    second = serializer.to_cdr(String(data='second'))
    bag.write('/words', second, log_time=2)
    with pytest.raises(OSError, match='No space left'):
        bag.flush()
    assert path.stat().st_size == size
    bag._mcap._file = file
    bag.close()
    assert [message.data for message in BagReader(path).messages()] == [first, second]


def test_memory_does_not_grow_with_the_length_of_a_bag(tmp_path: Path) -> None:
    import tracemalloc

    generator = np.random.default_rng(731)
    with BagWriter(tmp_path / 'run.mcap') as bag:
        bag.add_topic('/words', STRING)
        tracemalloc.start()
        for number in range(100):
            bag.write('/words', generator.bytes(200_000), log_time=number)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    # 20 MB went through; the chunk at hand is held a few times over while it is written.
    assert peak < 8 * CHUNK_SIZE
    bag_size = (tmp_path / 'run.mcap').stat().st_size
    tracemalloc.start()
    for _ in BagReader(tmp_path / 'run.mcap').messages():
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert bag_size > 100 * 200_000
    assert peak < 8 * CHUNK_SIZE
