"""Writes MCAP files that survive a crash, a kill and a full disk.

Specification: https://mcap.dev/spec. Messages are collected in a chunk, and `flush` appends the
chunk to the file. A file that is cut off at any byte can be read up to its last complete chunk.

The writers of the packages `mcap` and `rosbags` lack two properties. They cannot close a chunk
before it is full, so a setpoint every half minute would stay in memory for hours. After a failed
write they continue behind the incomplete chunk. The records are written by `mcap.records`.
"""

import contextlib
import io
import os
import zlib
from collections.abc import Callable
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b'\x89MCAP0\r\n'
PROFILE = 'ros2'
LIBRARY = 'porotwin'

CHUNK_SIZE = 1 << 20
"""Size at which a chunk is written without a call of `flush` [bytes]."""

_FASTEST = 1
"""Level of zstd: recording must keep up with the graph."""

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
        self._size = 0
        self._compressor = zstandard.ZstdCompressor(level=_FASTEST) if compress else None
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._records = RecordBuilder()
        self._entries: dict[int, list[tuple[int, int]]] = {}
        self._chunk_indexes: list[bytes] = []
        try:
            self._append(MAGIC + _bytes(Header(PROFILE, LIBRARY)))
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
        return self._size + self._records.count

    @property
    def readable_count(self) -> int:
        """Number of messages in the file: they survive the end of this process."""
        return self.message_count - sum(len(entries) for entries in self._entries.values())

    def add_schema(self, name: str, definition: str) -> int:
        """Add a message type with its `definition` (ros2msg) and return the id of its schema."""
        schema = Schema(len(self._schemas) + 1, definition.encode(), 'ros2msg', name)
        self._schemas.append(schema)
        schema.write(self._records)
        return schema.id

    def add_channel(self, topic: str, schema_id: int, metadata: dict[str, str]) -> int:
        """Add a topic and return the id of its channel."""
        channel = Channel(len(self._channels) + 1, topic, 'cdr', metadata, schema_id)
        self._channels.append(channel)
        self.message_counts[channel.id] = 0
        channel.write(self._records)
        return channel.id

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
        self._entries.setdefault(channel_id, []).append((log_time, self._records.count))
        message = Message(channel_id, log_time, data, publish_time, sequence & 0xFFFFFFFF)
        message.write(self._records)
        if self._records.count >= CHUNK_SIZE:
            self.flush()

    def flush(self) -> None:
        """Write all messages in memory; then they survive the end of this process.

        Raises:
            OSError: nothing was written; the messages stay in memory for the next flush.
        """
        if not self._entries:
            return
        records = self._records.end()
        try:
            self._write_chunk(records)
        except OSError:
            self._records.write(records)
            raise
        self._entries = {}

    def _write_chunk(self, records: bytes) -> None:
        data = self._compressor.compress(records) if self._compressor else records
        times = [time for entries in self._entries.values() for time, _ in entries]
        compression = 'zstd' if self._compressor else ''
        chunk = _bytes(
            Chunk(compression, data, max(times), min(times), zlib.crc32(records), len(records))
        )
        offsets: dict[int, int] = {}
        indexes = bytearray()
        for channel_id, entries in self._entries.items():
            offsets[channel_id] = self._size + len(chunk) + len(indexes)
            indexes += _bytes(MessageIndex(channel_id, entries))
        index = ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=self._size,
            compression=compression,
            compressed_size=len(data),
            message_end_time=max(times),
            message_index_length=len(indexes),
            message_index_offsets=offsets,
            message_start_time=min(times),
            uncompressed_size=len(records),
        )
        self._append(chunk + indexes)
        self._chunk_indexes.append(_bytes(index))

    def _append(self, data: bytes) -> None:
        """Append all of `data`, or restore the file and raise OSError."""
        rest = memoryview(data)
        try:
            self._file.seek(self._size)  # an earlier attempt may have ended anywhere
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with contextlib.suppress(OSError):  # a disk that is gone
                self._file.truncate(self._size)
            raise
        self._size += len(data)

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
        try:
            for position in range(0, self._size, CHUNK_SIZE):
                size = min(CHUNK_SIZE, self._size - position)
                rest = memoryview(os.pread(self._file.fileno(), size, position))
                while rest:
                    rest = rest[copy.write(rest) :]
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
        size = self._size
        try:
            self._append(self._end())
            os.fsync(self._file.fileno())
        except OSError:
            self._size = size
            with contextlib.suppress(OSError):  # a disk that is gone
                self._file.truncate(size)
            raise
        self._file.close()

    def _end(self) -> bytes:
        """Return the bytes behind the last chunk: the index, its index, and the footer."""
        data_end = _bytes(DataEnd(0))
        summary_start = self._size + len(data_end)
        groups = {
            Opcode.SCHEMA: [_bytes(schema) for schema in self._schemas],
            Opcode.CHANNEL: [_bytes(channel) for channel in self._channels],
            Opcode.CHUNK_INDEX: self._chunk_indexes,
            Opcode.STATISTICS: [_bytes(self._statistics())],
        }
        summary = bytearray()
        offsets = bytearray()
        for opcode, records in groups.items():
            start = summary_start + len(summary)
            summary += b''.join(records)
            length = summary_start + len(summary) - start
            if length:
                offsets += _bytes(SummaryOffset(opcode, start, length))
        offset_start = summary_start + len(summary)
        summary += offsets
        footer = _bytes(Footer(summary_start, offset_start, 0))
        checksum = zlib.crc32(summary + footer[:-4])
        return data_end + summary + footer[:-4] + checksum.to_bytes(4, 'little') + MAGIC

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self.message_counts,
            chunk_count=len(self._chunk_indexes),
            message_count=self.message_count,
            message_end_time=self.end_time,
            message_start_time=self.start_time,
            metadata_count=0,
            schema_count=len(self._schemas),
        )


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
