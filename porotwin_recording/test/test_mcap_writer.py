"""Tests of the MCAP writer: a kill or a full disk costs no flushed message."""

import io
import os
import signal
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from recording_examples import STRING
from std_msgs.msg import String

from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.mcap_writer import CHUNK_SIZE
from porotwin_recording.mcap.serialization import Serializer

KILLED = """
import sys, time
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import Serializer
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


class FileOnSmallDisk(io.FileIO):
    """A file that accepts `free` more bytes once that is a number, ten at a time."""

    free: int | None = None

    def write(self, data: memoryview) -> int:
        if self.free is None:
            return super().write(data)
        if self.free == 0:
            raise OSError(28, os.strerror(28))
        self.free -= 10
        return super().write(data[:10])


def test_a_full_disk_loses_nothing_and_leaves_no_debris(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    opened: list[FileOnSmallDisk] = []

    def open_file(path: Path) -> FileOnSmallDisk:
        opened.append(FileOnSmallDisk(path, 'x'))
        return opened[-1]

    bag = BagWriter(path, compress=False, open_file=open_file)
    (file,) = opened
    bag.add_topic('/words', STRING)
    serializer = Serializer()
    first = serializer.to_cdr(String(data='first'))
    bag.write('/words', first, log_time=1)
    bag.flush()
    size = path.stat().st_size
    file.free = 10
    second = serializer.to_cdr(String(data='second'))
    bag.write('/words', second, log_time=2)
    with pytest.raises(OSError, match='No space left'):
        bag.flush()
    assert path.stat().st_size == size
    file.free = None
    bag.close()
    assert [message.data for message in BagReader(path).messages()] == [first, second]


def test_memory_of_the_writer_is_bounded(tmp_path: Path) -> None:
    generator = np.random.default_rng(731)
    with BagWriter(tmp_path / 'run.mcap') as bag:
        bag.add_topic('/words', STRING)
        tracemalloc.start()
        for number in range(100):
            bag.write('/words', generator.bytes(200_000), log_time=number)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    # 20 MB were written; a chunk exists several times in memory while it is written
    assert peak < 8 * CHUNK_SIZE
