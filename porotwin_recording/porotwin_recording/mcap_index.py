"""The index of an MCAP file: the one at its end, or one that is built from its records.

Specification: https://mcap.dev/spec.
"""

import io
import re
import struct
import zlib
from dataclasses import dataclass, field
from typing import IO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.summary import Summary

from porotwin_recording.mcap_writer import MAGIC

RECORD_HEADER = struct.Struct('<BQ')
"""Opcode and length, at the beginning of every MCAP record."""

DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zstandard.ZstdError,
    ValueError,
    LookupError,
    MemoryError,
    OverflowError,
    RuntimeError,
)
"""Exceptions of the libraries that indicate damaged bytes."""

LARGEST_CHUNK = 1 << 30
"""Largest size of an uncompressed chunk [bytes]; writers close chunks at about a megabyte."""

_FOOTER_SIZE = RECORD_HEADER.size + 20
_CHECKSUM_SIZE = 4

_CHUNK = re.compile(
    rb'\x06.{8}.{8}.{8}.{8}.{4}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd)',
    re.DOTALL,
)
"""Begin of a record of a chunk: opcode, length, two times, size, checksum, compression."""

_CHUNK_BEGIN = struct.Struct('<BQQQQI')

_WINDOW = 1 << 22
"""Bytes that are searched at once for the next chunk behind a damage."""


@dataclass(frozen=True)
class Loss:
    """A damaged part of a file.

    Attributes:
        position: begin of the damaged part [bytes].
        reason: fault of its bytes.
        start_time: first log time [ns]; 0 if it is unknown.
        end_time: last log time [ns].
        counts: number of lost messages by channel, as far as it is known.
    """

    position: int
    reason: str
    start_time: int = 0
    end_time: int = 0
    counts: dict[int, int] = field(default_factory=dict)


@dataclass
class BuiltIndex:
    """The index that a scan of a file gives.

    Attributes:
        statistics: number and times of the messages.
        summary: schemas, channels and chunks.
        loose: log time [ns] and position [bytes] of the messages outside of chunks.
        losses: damaged parts.
        end: end of the last complete record [bytes].
        has_end: whether the file is closed.
    """

    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0))
    summary: Summary = field(default_factory=Summary)
    loose: list[tuple[int, int]] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    end: int = len(MAGIC)
    has_end: bool = False


def chunk_records(stream: IO[bytes], position: int) -> list[McapRecord]:
    """Return the records in the chunk at `position` [bytes] of the file.

    Raises:
        DAMAGE: the chunk is damaged.
    """
    stream.seek(position)
    opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
    if opcode != Opcode.CHUNK:
        raise ValueError('there is no chunk where the index says')
    chunk = Chunk.read(ReadDataStream(io.BytesIO(stream.read(length))))
    if chunk.uncompressed_size > LARGEST_CHUNK:
        raise ValueError(f'its chunk claims {chunk.uncompressed_size} bytes')
    if chunk.compression == 'zstd':
        size = zstandard.get_frame_parameters(chunk.data).content_size
        if size not in (chunk.uncompressed_size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError('two sizes of its chunk differ')
    return breakup_chunk(chunk, validate_crc=True)


def chunks_are_there(stream: IO[bytes], summary: Summary) -> bool:
    """Return whether every chunk of an index begins where the index says."""
    for index in summary.chunk_indexes:
        stream.seek(index.chunk_start_offset)
        header = stream.read(RECORD_HEADER.size)
        if header != RECORD_HEADER.pack(Opcode.CHUNK, index.chunk_length - RECORD_HEADER.size):
            return False
    return True


def own_index(stream: IO[bytes], size: int) -> Summary | None:
    """Return the index at the end of a file of `size` bytes; None if it is missing or damaged."""
    try:
        stream.seek(size - len(MAGIC) - _FOOTER_SIZE)
        tail = stream.read(_FOOTER_SIZE + len(MAGIC))
        footer = tail[:_FOOTER_SIZE]
        opcode, _, start, _, checksum = struct.unpack('<BQQQI', footer)
        if opcode != Opcode.FOOTER or tail[_FOOTER_SIZE:] != MAGIC or not 0 < start < size:
            return None
        stream.seek(start)
        content = stream.read(size - len(MAGIC) - _CHECKSUM_SIZE - start)
        if checksum not in (0, zlib.crc32(content)):
            return None
        stream.seek(0)
        summary = SeekingReader(stream).get_summary()
    except (*DAMAGE, OSError, StopIteration):
        return None
    if summary is None or summary.statistics is None:
        return None
    if any(
        index.chunk_start_offset + index.chunk_length > start for index in summary.chunk_indexes
    ):
        return None
    return summary


def built_index(stream: IO[bytes], size: int, own: Summary | None = None) -> BuiltIndex:
    """Return an index of all complete records in a file of `size` bytes.

    Args:
        stream: the file.
        size: its size [bytes].
        own: the index at its end, which names topics even if their records are damaged.
    """
    built = BuiltIndex()
    if own is not None:
        built.summary.schemas.update(own.schemas)
        built.summary.channels.update(own.channels)
    built.summary.statistics = built.statistics
    position = len(MAGIC)
    while position + RECORD_HEADER.size <= size:
        stream.seek(position)
        opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
        end = position + RECORD_HEADER.size + length
        if opcode == Opcode.DATA_END and length == _CHECKSUM_SIZE:
            stream.seek(size - len(MAGIC))
            built.has_end = stream.read() == MAGIC
            break
        try:
            if not 0 < opcode <= max(Opcode):
                raise ValueError('no MCAP record')
            if end > size:
                raise ValueError('a record is longer than the file')
            _add_record(built, stream, opcode, position, length)
        except DAMAGE as error:
            next_position = _next_chunk(stream, position + 1, size)
            if next_position is None and end > size:
                break  # cut off in the middle of a record
            reason = ' '.join(str(error).split()) or type(error).__name__
            loss, behind = _loss(stream, position, end, size, opcode, reason)
            built.losses.append(loss)
            end = next_position if next_position is not None else behind
        position = built.end = min(end, size)
    return built


def _loss(
    stream: IO[bytes], position: int, end: int, size: int, opcode: int, reason: str
) -> tuple[Loss, int]:
    """Return the loss at `position`, and the end of the records that belong to it [bytes]."""
    if opcode != Opcode.CHUNK or end > size:
        return Loss(position, reason), size
    stream.seek(position)
    _, _, first, last, _, _ = _CHUNK_BEGIN.unpack(stream.read(_CHUNK_BEGIN.size))
    counts: dict[int, int] = {}
    while end + RECORD_HEADER.size <= size:
        stream.seek(end)
        opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
        if opcode != Opcode.MESSAGE_INDEX or end + length > size:
            break
        try:
            content = io.BytesIO(stream.read(length))
            index = MessageIndex.read(ReadDataStream(content))
        except DAMAGE:
            break
        counts[index.channel_id] = len(index.records)
        end += RECORD_HEADER.size + length
    plausible = first <= last
    return Loss(position, reason, first * plausible, last * plausible, counts), end


def _next_chunk(stream: IO[bytes], position: int, size: int) -> int | None:
    """Return the begin of the next plausible chunk from `position` on [bytes]; None: none."""
    overlap = _CHUNK_BEGIN.size + len(b'\x04\x00\x00\x00zstd')
    while position < size:
        stream.seek(position)
        window = stream.read(_WINDOW + overlap)
        for match in _CHUNK.finditer(window):
            begin = position + match.start()
            _, length, first, last, _, _ = _CHUNK_BEGIN.unpack_from(window, match.start())
            if first <= last and begin + RECORD_HEADER.size + length <= size:
                return begin
        position += _WINDOW
    return None


def _add_record(
    built: BuiltIndex, stream: IO[bytes], opcode: int, position: int, length: int
) -> None:
    """Add the record at `position`, whose content of `length` bytes the stream gives next.

    Raises:
        DAMAGE: the record is damaged.
    """
    if opcode == Opcode.CHUNK:
        _add_chunk(built, chunk_records(stream, position), stream, position, length)
    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
        data = ReadDataStream(io.BytesIO(stream.read(length)))
        if opcode == Opcode.SCHEMA:
            _add(built, Schema.read(data))
        elif opcode == Opcode.CHANNEL:
            _add(built, Channel.read(data))
        else:
            message = Message.read(data, length)
            built.loose.append((message.log_time, position))
            _add(built, message)


def _add_chunk(
    built: BuiltIndex, records: list[McapRecord], stream: IO[bytes], position: int, length: int
) -> None:
    channels = set()
    for record in records:
        _add(built, record)
        if isinstance(record, Message):
            channels.add(record.channel_id)
    stream.seek(position)
    _, _, first, last, size, _ = _CHUNK_BEGIN.unpack(stream.read(_CHUNK_BEGIN.size))
    index = ChunkIndex(
        chunk_length=RECORD_HEADER.size + length,
        chunk_start_offset=position,
        compression='',  # read again from the chunk itself
        compressed_size=length,
        message_end_time=last,
        message_index_length=0,
        message_index_offsets=dict.fromkeys(channels, 0),
        message_start_time=first,
        uncompressed_size=size,
    )
    built.summary.chunk_indexes.append(index)


def _add(built: BuiltIndex, record: object) -> None:
    if isinstance(record, Schema):
        built.summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        built.summary.channels[record.id] = record
    elif isinstance(record, Message):
        _count(built.statistics, record)


def _count(found: Statistics, message: Message) -> None:
    counts = found.channel_message_counts
    counts[message.channel_id] = counts.get(message.channel_id, 0) + 1
    first = found.message_count == 0
    earliest = message.log_time if first else min(found.message_start_time, message.log_time)
    found.message_start_time = earliest
    found.message_end_time = max(found.message_end_time, message.log_time)
    found.message_count += 1
