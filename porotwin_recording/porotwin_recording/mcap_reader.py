"""Reads MCAP files, complete or cut off by a crash.

Specification: https://mcap.dev/spec. The package `mcap` reads the records. It needs the index at
the end of the file, which is missing after a crash; then the index is built from all complete
chunks.
"""

import io
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Message, Schema, Statistics
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.summary import Summary

from porotwin_core.errors import InputError
from porotwin_recording.bag_records import BagMessage, Topic, qos_from_yaml
from porotwin_recording.mcap_writer import MAGIC

_RECORD_HEADER = struct.Struct('<BQ')
"""Opcode and length, at the beginning of every MCAP record."""

_DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zstandard.ZstdError,
    UnicodeDecodeError,
    LookupError,
    MemoryError,
)
"""Exceptions of the libraries that indicate damaged bytes."""


@dataclass(frozen=True)
class McapFile:
    """One MCAP file with its index.

    Attributes:
        path: the file.
        summary: the index.
        end: end of the last complete record [bytes].
        complete: False if the file has no index of its own.
        topics: its topics by absolute name.
        statistics: number and times of its messages.
    """

    path: Path
    summary: Summary
    end: int
    complete: bool
    topics: dict[str, Topic]
    statistics: Statistics

    def messages(
        self, topics: Collection[str] | None, start: int | None, stop: int | None
    ) -> Iterator[BagMessage]:
        """Yield the messages of `topics` from `start` to before `stop` [ns], by log time.

        None stands for all topics, the first and the last message.

        Raises:
            InputError: a chunk is damaged.
        """
        with self.path.open('rb') as stream:
            reader = _IndexedReader(_Bounded(stream, self.end), self.summary)
            found = reader.iter_messages(topics, starting_at=start, ending_before=stop)
            while True:
                try:
                    schema, channel, message = next(found)
                except StopIteration:
                    return
                except _DAMAGE as error:
                    if not self.complete and not self.summary.chunk_indexes:
                        return
                    reason = ' '.join(str(error).split()) or type(error).__name__
                    raise InputError(
                        f"{self.path}: damaged ({reason}); save the rest with 'mcap recover'"
                    ) from None
                yield BagMessage(
                    channel.topic,
                    schema.name if schema else '',
                    message.log_time,
                    message.publish_time,
                    message.sequence,
                    message.data,
                )


def open_mcap(path: Path, remark: Callable[[str], None]) -> McapFile:
    """Return the MCAP file at `path`; `remark` receives one line if it has no end.

    Raises:
        InputError: the file is empty, no MCAP file, or cannot be read.
    """
    try:
        with path.open('rb') as stream:
            magic = stream.read(len(MAGIC))
            if magic != MAGIC:
                fault = 'empty' if not magic else 'not an MCAP file'
                raise InputError(f'{path}: is {fault}; name a bag made by ./porotwin record')
            size = path.stat().st_size
            summary = _own_index(stream)
            end, complete = size, summary is not None
            if summary is None:
                summary, end = _built_index(stream, size)
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror})') from None
    statistics = summary.statistics
    assert statistics is not None
    if not complete:
        remark(
            f'{path}: has no end, because its recorder is running or was killed; '
            f'{statistics.message_count} messages are in its first {end} of {size} bytes'
        )
    topics = merged_topics(
        _topic(summary, channel, statistics) for channel in summary.channels.values()
    )
    return McapFile(path, summary, end, complete, topics, statistics)


def merged_topics(topics: Iterator[Topic]) -> dict[str, Topic]:
    """Return topics by name; equal names become one topic with the sum of the messages."""
    merged: dict[str, Topic] = {}
    for topic in topics:
        known = merged.get(topic.name)
        count = topic.message_count + (known.message_count if known else 0)
        merged[topic.name] = replace(known or topic, message_count=count)
    return merged


def _topic(summary: Summary, channel: Channel, statistics: Statistics) -> Topic:
    schema = summary.schemas.get(channel.schema_id)
    return Topic(
        channel.topic,
        schema.name if schema else '',
        qos_from_yaml(channel.metadata.get('offered_qos_profiles', '')),
        schema.data.decode() if schema and schema.encoding == 'ros2msg' else '',
        statistics.channel_message_counts.get(channel.id, 0),
    )


class _Bounded(io.RawIOBase):
    """A file that appears to end at `end`, before an incomplete record."""

    def __init__(self, stream: IO[bytes], end: int) -> None:
        self._stream = stream
        self._end = end

    def readinto(self, buffer: Any) -> int:
        available = max(0, self._end - self._stream.tell())
        return self._stream.readinto(memoryview(buffer)[:available])  # type: ignore[attr-defined]

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._stream.seek(offset, whence)

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True


class _IndexedReader(SeekingReader):
    """A reader that receives its index instead of reading it from the end of the file."""

    def __init__(self, stream: io.RawIOBase, summary: Summary) -> None:
        super().__init__(stream, validate_crcs=True)  # type: ignore[arg-type]
        self._summary = summary

    def get_summary(self) -> Summary | None:
        return self._summary


def _own_index(stream: IO[bytes]) -> Summary | None:
    """Return the index at the end of a complete file; None if it is missing or damaged."""
    try:
        stream.seek(-len(MAGIC), io.SEEK_END)
        if stream.read(len(MAGIC)) != MAGIC:
            return None
        stream.seek(0)
        summary = SeekingReader(stream).get_summary()
    except (*_DAMAGE, OSError, StopIteration):
        return None
    if summary is None or summary.statistics is None:
        return None
    return summary


def _built_index(stream: IO[bytes], size: int) -> tuple[Summary, int]:
    """Return an index of all complete records in a file of `size` bytes, and their end [bytes]."""
    builder = _IndexBuilder(stream)
    position = len(MAGIC)
    while position + _RECORD_HEADER.size <= size:
        stream.seek(position)
        opcode, length = _RECORD_HEADER.unpack(stream.read(_RECORD_HEADER.size))
        end = position + _RECORD_HEADER.size + length
        if end > size or opcode == Opcode.DATA_END or not 0 < opcode <= max(Opcode):
            break
        try:
            builder.read_record(opcode, position, length)
        except _DAMAGE:
            break
        position = end
    return builder.summary, position


class _IndexBuilder:
    """Builds the index of an MCAP file record by record."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.summary = Summary()
        self._statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)
        self.summary.statistics = self._statistics
        self._stream = stream

    def read_record(self, opcode: int, position: int, length: int) -> None:
        """Add the record at `position`, whose content the stream gives next.

        Args:
            opcode: type of the record.
            position: begin of the record in the file [bytes].
            length: length of its content [bytes].
        """
        data = ReadDataStream(self._stream)
        if opcode == Opcode.SCHEMA:
            self._add(Schema.read(data))
        elif opcode == Opcode.CHANNEL:
            self._add(Channel.read(data))
        elif opcode == Opcode.MESSAGE:
            self._add(Message.read(data, length))
        elif opcode == Opcode.CHUNK:
            self._add_chunk(Chunk.read(data), position, length)

    def _add_chunk(self, chunk: Chunk, position: int, length: int) -> None:
        channels = set()
        for record in breakup_chunk(chunk, validate_crc=True):
            self._add(record)
            if isinstance(record, Message):
                channels.add(record.channel_id)
        index = ChunkIndex(
            chunk_length=_RECORD_HEADER.size + length,
            chunk_start_offset=position,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=0,
            message_index_offsets=dict.fromkeys(channels, 0),
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        self.summary.chunk_indexes.append(index)

    def _add(self, record: object) -> None:
        if isinstance(record, Schema):
            self.summary.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.summary.channels[record.id] = record
        elif isinstance(record, Message):
            self._count(record)

    def _count(self, message: Message) -> None:
        found = self._statistics
        counts = found.channel_message_counts
        counts[message.channel_id] = counts.get(message.channel_id, 0) + 1
        first = found.message_count == 0
        earliest = message.log_time if first else min(found.message_start_time, message.log_time)
        found.message_start_time = earliest
        found.message_end_time = max(found.message_end_time, message.log_time)
        found.message_count += 1
