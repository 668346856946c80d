"""Tests of the MCAP reader: files that a crash cut off, damaged files, files of another kind."""

import random
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from bag_examples import write_setpoints
from recording_examples import STRING
from std_msgs.msg import String

from porotwin_core.errors import InputError
from porotwin_recording.bag_reader import BagReader
from porotwin_recording.bag_writer import BagWriter
from porotwin_recording.mcap_writer import CHUNK_SIZE
from porotwin_recording.serialization import Serializer


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


def test_a_damaged_chunk_is_named(tmp_path: Path) -> None:
    write_setpoints(tmp_path / 'run.mcap', compress=False)
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
