"""Tests of the MCAP reader: files that a crash cut off, damaged files, files of another kind."""

import random
import struct
import tracemalloc
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from recording_examples import STRING
from std_msgs.msg import String

from porotwin_core.basis.errors import InputError
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.mcap_writer import CHUNK_SIZE
from porotwin_recording.mcap.serialization import SECOND, Serializer


@pytest.mark.parametrize('compress', [True, False])
def test_a_file_cut_at_any_byte_gives_every_complete_chunk(tmp_path: Path, compress: bool) -> None:
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
        # the index behind a chunk may be cut although the chunk is complete
        least = sum(end <= cut for end in ends)
        assert least <= len(found) <= least + 1
        assert found == written[: len(found)]
        assert bag.message_count == len(found)
        assert 'has no end' in bag.remarks[0]


def test_a_message_of_the_latest_time_is_read(tmp_path: Path) -> None:
    latest = 2**64 - 1
    with BagWriter(tmp_path / 'run.mcap') as bag:
        bag.add_topic('/words', STRING)
        bag.write('/words', Serializer().to_cdr(String(data='late')), log_time=latest)
    (found,) = BagReader(tmp_path / 'run.mcap').messages(start=latest, stop=latest + 1)
    assert found.log_time == latest


def write_words(path: Path, chunks: int = 6, words: int = 5, *, compress: bool = True) -> list[int]:
    """Write chunks of words, one word per second; return the ends of the chunks [bytes]."""
    serializer = Serializer()
    ends = []
    with BagWriter(path, compress=compress) as bag:
        bag.add_topic('/words', STRING)
        for number in range(chunks * words):
            data = serializer.to_cdr(String(data=f'word {number}'))
            bag.write('/words', data, log_time=number * SECOND)
            if number % words == words - 1:
                bag.flush()
                ends.append(path.stat().st_size)
    return ends


def seconds(bag: BagReader) -> list[int]:
    return [message.log_time // SECOND for message in bag.messages()]


DAMAGES = {
    'a flipped bit': lambda part: part[:60] + bytes([part[60] ^ 1]) + part[61:],
    'a flipped opcode': lambda part: b'\x77' + part[1:],
    'a length beyond the file': lambda part: part[:8] + b'\x7f' + part[9:],
    'a size of 4e9': lambda part: part[:25] + b'\xff' * 4 + part[29:],
    'zeros': lambda part: bytes(len(part)),
    'noise': lambda part: random.Random(731).randbytes(len(part)),
    'missing bytes': lambda part: part[:60] + part[67:],
}


@pytest.mark.parametrize('closed', [True, False])
@pytest.mark.parametrize('compress', [True, False])
@pytest.mark.parametrize('damage', DAMAGES)
def test_a_damaged_chunk_costs_its_own_messages(
    tmp_path: Path, damage: str, compress: bool, closed: bool
) -> None:
    path = tmp_path / 'run.mcap'
    ends = write_words(path, compress=compress)
    content = path.read_bytes()
    rest = content[ends[2] :] if closed else content[ends[2] : ends[-1]]
    path.write_bytes(content[: ends[1]] + DAMAGES[damage](content[ends[1] : ends[2]]) + rest)
    bag = BagReader(path)
    found = seconds(bag)
    assert found == [second for second in range(30) if not 10 <= second < 15]
    assert seconds(bag) == found
    losses = [remark for remark in bag.remarks if 'damaged at byte' in remark]
    assert len(losses) == 1
    if damage == 'a flipped bit':
        assert 'lost: 5 messages on /words between 10.0 and 14.0 s' in losses[0]


def test_a_damaged_index_is_built_again(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    ends = write_words(path)
    content = bytearray(path.read_bytes())
    content[ends[-1] + 40] ^= 4
    path.write_bytes(content)
    bag = BagReader(path)
    assert seconds(bag) == list(range(30))
    assert 'its index is damaged; 30 messages were found without it' in bag.remarks[0]


def test_without_the_first_chunk_the_index_names_the_topics(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    ends = write_words(path)
    content = path.read_bytes()
    first = content.index(b'\x06', 8)
    damaged = content[:first] + bytes(ends[0] - first) + content[ends[0] :]
    path.write_bytes(damaged)
    assert seconds(BagReader(path)) == list(range(5, 30))
    path.write_bytes(damaged[: ends[-1]])
    bag = BagReader(path)
    assert seconds(bag) == []
    assert '25 messages lost, because the names of their topics are damaged' in bag.remarks[1]
    assert bag.message_count == 0


def test_messages_outside_of_chunks_are_read_by_log_time(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / 'run.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start('ros2', 'strangers')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data\n')
        channel = writer.register_channel('/words', 'cdr', schema)
        for second in (3, 1, 2):
            writer.add_message(channel, second * SECOND, b'', second * SECOND)
        writer.finish()
    assert seconds(BagReader(path)) == [1, 2, 3]


@pytest.mark.parametrize('seed', range(40))
def test_random_damage_is_survived_in_bounded_memory(tmp_path: Path, seed: int) -> None:
    path = tmp_path / 'run.mcap'
    write_words(path, compress=seed % 2 == 0)
    generator = random.Random(seed)
    content = bytearray(path.read_bytes())
    for _ in range(generator.choice([1, 3, 30])):
        content[generator.randrange(len(content))] = generator.choice([0, 255, 6, 3, 128])
    path.write_bytes(content[: generator.choice([None, generator.randrange(len(content))])])
    tracemalloc.start()
    try:
        bag = BagReader(path)
        for message in bag.messages():
            try:
                bag.decode(message)
            except InputError as error:
                assert '\n' not in str(error)
    except InputError as error:
        assert '\n' not in str(error)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 32 << 20


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


def test_memory_does_not_grow_with_the_length_of_a_file(tmp_path: Path) -> None:
    generator = np.random.default_rng(731)
    with BagWriter(tmp_path / 'run.mcap') as bag:
        bag.add_topic('/words', STRING)
        for number in range(100):
            bag.write('/words', generator.bytes(200_000), log_time=number)
    tracemalloc.start()
    for _ in BagReader(tmp_path / 'run.mcap').messages():
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / 'run.mcap').stat().st_size > 100 * 200_000
    assert peak < 8 * CHUNK_SIZE


ZEROS = bytes(200_000_000)


@pytest.mark.parametrize(
    ('compression', 'packed', 'claimed'),
    [
        ('zstd', zstandard.compress(ZEROS), len(ZEROS)),  # no records
        ('zstd', zstandard.compress(b'\x7f' + bytes(8)) , 9 << 30),
        ('lz4', lz4.frame.compress(ZEROS), 1000),  # more than it claims
        ('lz4', lz4.frame.compress((b'\x7f' + bytes(8)) * 1_000_001), 9 * 1_000_001),
    ],
)  # fmt: skip
def test_a_chunk_that_claims_or_holds_too_much_is_damaged(
    tmp_path: Path, compression: str, packed: bytes, claimed: int
) -> None:
    path = tmp_path / 'run.mcap'
    write_words(path, chunks=1)
    chunk = struct.pack('<QQQII', 0, 0, claimed, 0, len(compression)) + compression.encode()
    chunk += struct.pack('<Q', len(packed)) + packed
    content = path.read_bytes()
    end = content.rindex(struct.pack('<BQ', Opcode.DATA_END, 4))
    record = struct.pack('<BQ', Opcode.CHUNK, len(chunk)) + chunk
    path.write_bytes(content[:end] + record)  # the recorder was killed
    tracemalloc.start()
    bag = BagReader(path)
    assert len(list(bag.messages())) == 5
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert any('damaged at byte' in remark for remark in bag.remarks)
    assert most < 2.5 * len(ZEROS)
