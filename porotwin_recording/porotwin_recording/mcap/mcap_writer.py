"""Writes MCAP files that survive a crash, a kill and a full disk.

Specification: https://mcap.dev/spec. The library `mcap` collects messages in chunks and makes all
records. Its bytes wait here until the disk has taken all of them, because a file must not go on
behind a chunk that the disk took in part. A file that is cut off at any byte can be read up to its
last complete chunk.
"""

import contextlib
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

CHUNK_SIZE = 1 << 20
"""Bytes of a chunk that are written together, or unpacked at once; memory follows it."""


MAGIC = b'\x89MCAP0\r\n'
PROFILE = 'ros2'
LIBRARY = 'porotwin'

OpenFn = Callable[[Path], io.FileIO]
"""Creates a file for unbuffered writing.

Raises OSError if the file exists already or cannot be created.
"""


def new_file(path: Path) -> io.FileIO:
    """Create the file `path` for unbuffered writing.

    Raises:
        OSError: the file exists already or cannot be created.
    """
    return path.open('x+b', buffering=0)


class _Spool:
    """Takes the bytes that the library writes, until the file has them.

    Attributes:
        size: size of the file [bytes].
        waiting: the bytes behind it.
    """

    def __init__(self) -> None:
        self.size = 0
        self.waiting = b''

    def write(self, data: bytes) -> int:
        self.waiting += data
        return len(data)

    def tell(self) -> int:
        return self.size + len(self.waiting)

    def flush(self) -> None:
        """Do nothing: the library may not decide when the disk is asked."""

    def drain(self, file: io.FileIO) -> None:
        """Append all waiting bytes to the file, or restore it and raise OSError."""
        try:
            file.seek(self.size)  # an earlier attempt may have ended anywhere
            _write_all(file, self.waiting)
        except OSError:
            with contextlib.suppress(OSError):  # a disk that is gone
                file.truncate(self.size)
            raise
        self.size += len(self.waiting)
        self.waiting = b''


class McapWriter:
    """Appends schemas, channels and messages to a new MCAP file at `path`.

    The file changes only when a chunk is written.

    Args:
        path: the file.
        compress: compress chunks with zstd.
        open_file: creates the file for unbuffered writing.

    Attributes:
        message_counts: number of messages of every channel.
        start_time: earliest log time [ns]; 0 without messages.
        end_time: latest log time [ns]; 0 without messages.

    Raises:
        OSError: the file exists already or cannot be created.
    """

    def __init__(self, path: Path, *, compress: bool = True, open_file: OpenFn = new_file) -> None:
        self.message_counts: dict[int, int] = {}
        self.start_time = 0
        self.end_time = 0
        self._open_file = open_file
        self._file = open_file(path)
        self._spool = _Spool()
        self._writer = Writer(
            cast(IO[bytes], self._spool),
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.ZSTD if compress else CompressionType.NONE,
            use_summary_offsets=False,  # optional; a second call of `finish` would repeat them
        )
        self._in_chunk = self._unflushed_count = 0
        self._writer.start(PROFILE, LIBRARY)
        try:
            self._spool.drain(self._file)
        except OSError:
            self.discard(path)
            raise

    @property
    def message_count(self) -> int:
        """Number of messages written so far, flushed or not."""
        return sum(self.message_counts.values())

    @property
    def size(self) -> int:
        """Size of the file and of the messages in memory [bytes]."""
        return self._spool.tell() + self._in_chunk

    @property
    def readable_count(self) -> int:
        """Number of messages in the file: they survive the end of this process."""
        return self.message_count - self._unflushed_count

    def add_schema(self, name: str, definition: str) -> int:
        """Add a message type with its `definition` (ros2msg) and return the id of its schema."""
        return cast(int, self._writer.register_schema(name, 'ros2msg', definition.encode()))

    def add_channel(self, topic: str, schema_id: int, metadata: dict[str, str]) -> int:
        """Add a topic and return the id of its channel."""
        number = self._writer.register_channel(topic, 'cdr', schema_id, metadata)
        self.message_counts[number] = 0
        return number

    def write(
        self, channel_id: int, data: bytes, *, log_time: int, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a serialized message.

        Args:
            channel_id: its topic, see `add_channel`.
            data: the message.
            log_time: when the recorder received it [ns]; negative times, which MCAP lacks,
                become 0.
            publish_time: when it was published [ns]; treated in the same way.
            sequence: the publisher's count of its messages.

        Raises:
            OSError: the chunk was full and could not be written; the message stays in memory for
                the next flush.
        """
        log_time, publish_time = max(0, log_time), max(0, publish_time)
        first = self.message_count == 0
        self.start_time = log_time if first else min(self.start_time, log_time)
        self.end_time = max(self.end_time, log_time)
        self.message_counts[channel_id] += 1
        self._unflushed_count += 1
        self._in_chunk += len(data)
        self._writer.add_message(channel_id, log_time, data, publish_time, sequence & 0xFFFFFFFF)
        if self._spool.waiting:
            self.flush()

    def flush(self) -> None:
        """Write all messages in memory; then they survive the end of this process.

        Raises:
            OSError: nothing was written; the messages stay in memory for the next flush.
        """
        self._writer.flush()
        self._in_chunk = 0
        self._spool.drain(self._file)
        self._unflushed_count = 0

    def is_there(self, path: Path) -> bool:
        """Return whether `path` leads to the open file."""
        try:
            return os.path.samestat(path.stat(), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            return False

    def move_to(self, path: Path) -> None:
        """Copy everything written so far to the new file `path`, and go on there.

        Raises:
            OSError: the file exists already or cannot be written; this one stays open.
        """
        copy = self._open_file(path)
        size = self._spool.size
        try:
            for position in range(0, size, CHUNK_SIZE):
                count = min(CHUNK_SIZE, size - position)
                _write_all(copy, os.pread(self._file.fileno(), count, position))
        except OSError:
            copy.close()
            path.unlink(missing_ok=True)
            raise
        self._file.close()
        self._file = copy

    def discard(self, path: Path) -> None:
        """Close the file and remove it from `path`."""
        self._file.close()
        path.unlink(missing_ok=True)

    def close(self) -> None:
        """Write the messages in memory, the index and the end of the file, and close it.

        Raises:
            OSError: the end could not be written; flushed messages are safe.
        """
        try:
            self.close_if_complete()
        finally:
            self._file.close()

    def close_if_complete(self) -> None:
        """Write the messages in memory, the index and the end of the file, and close it.

        Raises:
            OSError: the end could not be written; the file stays open and may go on.
        """
        self.flush()
        size = self._spool.size
        self._writer.finish()
        try:
            self._spool.drain(self._file)
            os.fsync(self._file.fileno())
        except OSError:
            self._spool.size, self._spool.waiting = size, b''
            with contextlib.suppress(OSError):  # a disk that is gone
                self._file.truncate(size)
            raise
        self._file.close()


def _write_all(file: io.FileIO, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]
