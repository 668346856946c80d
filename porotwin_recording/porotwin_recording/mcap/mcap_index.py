"""The index of an MCAP file: the one at its end, or one that is built from its records.

Specification: https://mcap.dev/spec.
"""

import io
import re
import struct
import zlib
from dataclasses import dataclass, field, replace
from typing import IO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE, SeekingReader
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

from porotwin_core.basis.declared_size import check_declared
from porotwin_recording.mcap.mcap_writer import CHUNK_SIZE, MAGIC

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

MOST_RECORDS = 1_000_000
"""Most records in a chunk: they take seconds, and writers close chunks at about a megabyte."""

NO_PLACE = 0
"""Place of a message index that is not known."""

_CHECKSUM_SIZE = 4

_CHUNK = re.compile(
    rb'\x06.{8}.{8}.{8}.{8}.{4}(?:\x00\x00\x00\x00|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd)',
    re.DOTALL,
)
"""Begin of a record of a chunk: opcode, length, two times, size, checksum, compression."""

_CHUNK_BEGIN = struct.Struct('<BQQQQI')

_MESSAGE_BEGIN = struct.Struct('<BQHIQQ')
"""Begin of a message: opcode, length, channel, sequence, log time, publish time."""

LARGE_CHUNK = 4 << 20
"""Size of a chunk above which only the wanted begins of its messages are read, and bytes that are
searched at once for the next chunk behind a damage [bytes]."""


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
        behind: begin of another MCAP file behind the end of this one [bytes]; None: there is none.
    """

    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0))
    summary: Summary = field(default_factory=Summary)
    loose: list[tuple[int, int]] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    end: int = len(MAGIC)
    has_end: bool = False
    behind: int | None = None


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
    check_declared('its chunk', (chunk.uncompressed_size,))
    if chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(
            chunk.data, max_length=chunk.uncompressed_size + 1
        )
        chunk = replace(chunk, compression='', data=data)
    if chunk.compression == 'zstd':
        size = zstandard.get_frame_parameters(chunk.data).content_size
        if size not in (chunk.uncompressed_size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError('two sizes of its chunk differ')
        data = zstandard.decompress(chunk.data, chunk.uncompressed_size)
        chunk = replace(chunk, compression='', data=data)
    if len(chunk.data) != chunk.uncompressed_size:
        raise ValueError('its chunk has another size than it says')
    _check_records(chunk.data)
    return breakup_chunk(chunk, validate_crc=True)


def _check_records(data: bytes) -> None:
    """Check the records of a chunk by their headers.

    Raises:
        ValueError: they are no records, or too many.
    """
    place = 0
    for _ in range(MOST_RECORDS):
        if place >= len(data):
            return
        opcode, length = RECORD_HEADER.unpack_from(data, place)
        if not opcode:
            raise ValueError('its chunk holds no records')
        place += RECORD_HEADER.size + length
    raise ValueError(f'its chunk has more than {MOST_RECORDS} records')


def message_heads(
    stream: IO[bytes], index: ChunkIndex, limits: dict[int, int | None]
) -> list[Message]:
    """Return messages of a chunk, each as far as it is wanted; the rest of the chunk is not read.

    Nothing is checked: a damaged chunk may give wrong messages.

    Args:
        stream: the file.
        index: the chunk, with the places of its message indexes.
        limits: most bytes of a message by channel; None: the whole message. Channels that are not
            named are left out.

    Raises:
        DAMAGE: the chunk is damaged, or compressed in another way than by zstd.
    """
    places = [
        (place, channel)
        for channel, position in index.message_index_offsets.items()
        if channel in limits
        for _, place in _message_index(stream, position).records
    ]
    content = _ChunkContent(stream, index.chunk_start_offset)
    return [content.message(place, limits[channel]) for place, channel in sorted(places)]


def _message_index(stream: IO[bytes], position: int) -> MessageIndex:
    stream.seek(position)
    opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
    if opcode != Opcode.MESSAGE_INDEX:
        raise ValueError('there is no message index where the index says')
    return MessageIndex.read(ReadDataStream(io.BytesIO(stream.read(length))))


class _ChunkContent:
    """Reads the records of a chunk forward, without holding all of it."""

    def __init__(self, stream: IO[bytes], position: int) -> None:
        """Begin to read the chunk at `position` [bytes]."""
        stream.seek(position + _CHUNK_BEGIN.size)
        compression = stream.read(int.from_bytes(stream.read(4), 'little'))
        stream.read(8)  # the length of the records
        if compression not in (b'', b'zstd'):
            raise ValueError('chunks of this compression are read as a whole')
        self._source: IO[bytes] = (
            zstandard.ZstdDecompressor().stream_reader(stream) if compression else stream
        )
        self._at = 0

    def message(self, place: int, limit: int | None) -> Message:
        """Return the message at `place` [bytes], with at most `limit` bytes of its data."""
        self._skip(place - self._at)
        opcode, length, channel, sequence, log_time, publish_time = _MESSAGE_BEGIN.unpack(
            self._read(_MESSAGE_BEGIN.size)
        )
        if opcode != Opcode.MESSAGE:
            raise ValueError('there is no message where the index says')
        check_declared('its message', (length,))
        size = length + RECORD_HEADER.size - _MESSAGE_BEGIN.size
        data = self._read(size if limit is None else min(size, limit))
        return Message(channel, log_time, data, publish_time, sequence)

    def _skip(self, count: int) -> None:
        while count > 0:
            count -= len(self._read(min(count, CHUNK_SIZE)))

    def _read(self, count: int) -> bytes:
        data = self._source.read(count)
        if len(data) < count:
            raise ValueError('its chunk is too short')
        self._at += count
        return data


def chunks_are_there(stream: IO[bytes], summary: Summary) -> bool:
    """Return whether every chunk of an index begins where the index says."""
    for index in summary.chunk_indexes:
        stream.seek(index.chunk_start_offset)
        header = stream.read(RECORD_HEADER.size)
        if header != RECORD_HEADER.pack(Opcode.CHUNK, index.chunk_length - RECORD_HEADER.size):
            return False
    return True


def summary_section(stream: IO[bytes], size: int) -> tuple[int, bytes] | None:
    """Return the begin of the summary [bytes] and its bytes, of a file of `size` bytes.

    None: the file has no end or no summary, or its summary is damaged.
    """
    if size < 2 * len(MAGIC) + FOOTER_SIZE:
        return None
    stream.seek(size - len(MAGIC) - FOOTER_SIZE)
    tail = stream.read(FOOTER_SIZE + len(MAGIC))
    opcode, _, start, _, checksum = struct.unpack('<BQQQI', tail[:FOOTER_SIZE])
    if opcode != Opcode.FOOTER or tail[FOOTER_SIZE:] != MAGIC or not 0 < start < size:
        return None
    stream.seek(start)
    content = stream.read(size - len(MAGIC) - _CHECKSUM_SIZE - start)
    return (start, content) if checksum in (0, zlib.crc32(content)) else None


def own_index(stream: IO[bytes], size: int) -> Summary | None:
    """Return the index at the end of a file of `size` bytes; None if it is missing or damaged."""
    try:
        section = summary_section(stream, size)
        stream.seek(0)
        summary = SeekingReader(stream).get_summary() if section else None
    except (*DAMAGE, OSError, StopIteration):
        return None
    if section is None or summary is None or summary.statistics is None:
        return None
    start, _ = section
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
            _add_end(built, stream, end, size)
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


def skimmed_index(stream: IO[bytes], size: int) -> BuiltIndex | None:
    """Return an index from the headers of the records, without the content of the chunks.

    A file of 100 GB takes seconds; the `StreamReader` of `mcap` would read all its bytes. Damage
    within a chunk shows when it is read.

    Args:
        stream: the file.
        size: its size [bytes].

    Returns:
        None if the headers do not lead to all messages: `built_index` then looks closer.
    """
    built = BuiltIndex()
    built.summary.statistics = built.statistics
    position = len(MAGIC)
    try:
        while position + RECORD_HEADER.size <= size:
            stream.seek(position)
            opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
            end = position + RECORD_HEADER.size + length
            if opcode == Opcode.DATA_END and length == _CHECKSUM_SIZE:
                _add_end(built, stream, end, size)
                break
            if end > size:
                if _next_chunk(stream, position + 1, size) is not None:
                    return None
                break
            if not _skim_record(built, stream, opcode, position, length):
                return None
            position = built.end = end
        return built if _is_complete(built, stream) else None
    except DAMAGE:
        return None


def _skim_record(
    built: BuiltIndex, stream: IO[bytes], opcode: int, position: int, length: int
) -> bool:
    """Add a record to an index; return whether its header was enough."""
    chunks = built.summary.chunk_indexes
    if opcode == Opcode.CHUNK:
        if chunks and not chunks[-1].message_index_offsets:
            return False
        stream.seek(position)
        chunks.append(_chunk_index(stream, position, length, {}))
    elif opcode == Opcode.MESSAGE_INDEX and chunks:
        index = MessageIndex.read(ReadDataStream(io.BytesIO(stream.read(length))))
        if index.records:
            chunks[-1].message_index_offsets[index.channel_id] = position
            times = [time for time, _ in index.records]
            _count(built.statistics, index.channel_id, len(times), min(times), max(times))
    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        _add_record(built, stream, opcode, position, length)
    else:
        return opcode in (Opcode.HEADER, Opcode.METADATA, Opcode.ATTACHMENT)
    return True


def _is_complete(built: BuiltIndex, stream: IO[bytes]) -> bool:
    """Look into the chunks that hold names of topics; return whether all topics have one.

    The last chunk may lack the indexes of its messages, which are counted here.
    """
    chunks, known = built.summary.chunk_indexes, built.summary.channels
    if chunks and not chunks[-1].message_index_offsets:
        last = chunks.pop()
        stream.seek(last.chunk_start_offset + RECORD_HEADER.size)
        length = last.chunk_length - RECORD_HEADER.size
        records = chunk_records(stream, last.chunk_start_offset)
        _add_chunk(built, records, stream, last.chunk_start_offset, length)
    counts = built.statistics.channel_message_counts
    for chunk in chunks:
        if counts.keys() <= known.keys():
            break
        for record in chunk_records(stream, chunk.chunk_start_offset):
            if isinstance(record, Schema | Channel):
                _add(built, record)
    return counts.keys() <= known.keys()


def _add_end(built: BuiltIndex, stream: IO[bytes], position: int, size: int) -> None:
    """Add whether a file is closed behind its data, which end at `position` [bytes]."""
    stream.seek(size - len(MAGIC))
    built.has_end = stream.read() == MAGIC
    while position + RECORD_HEADER.size <= size:
        stream.seek(position)
        opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
        position += RECORD_HEADER.size + length
        if opcode == Opcode.FOOTER:
            position += len(MAGIC)
            stream.seek(position)
            built.behind = position if stream.read(len(MAGIC)) == MAGIC else None
            return


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
        window = stream.read(LARGE_CHUNK + overlap)
        for match in _CHUNK.finditer(window):
            begin = position + match.start()
            _, length, first, last, _, _ = _CHUNK_BEGIN.unpack_from(window, match.start())
            if first <= last and begin + RECORD_HEADER.size + length <= size:
                return begin
        position += LARGE_CHUNK
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
    index = _chunk_index(stream, position, length, dict.fromkeys(channels, NO_PLACE))
    built.summary.chunk_indexes.append(index)


def _chunk_index(
    stream: IO[bytes], position: int, length: int, offsets: dict[int, int]
) -> ChunkIndex:
    """Return the index of the chunk whose record begins at the position of the stream."""
    _, _, first, last, size, _ = _CHUNK_BEGIN.unpack(stream.read(_CHUNK_BEGIN.size))
    return ChunkIndex(
        chunk_length=RECORD_HEADER.size + length,
        chunk_start_offset=position,
        compression='',  # read again from the chunk itself
        compressed_size=length,
        message_end_time=last,
        message_index_length=0,
        message_index_offsets=offsets,
        message_start_time=first,
        uncompressed_size=size,
    )


def _add(built: BuiltIndex, record: object) -> None:
    if isinstance(record, Schema):
        built.summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        built.summary.channels[record.id] = record
    elif isinstance(record, Message):
        _count(built.statistics, record.channel_id, 1, record.log_time, record.log_time)


def _count(found: Statistics, channel: int, count: int, first: int, last: int) -> None:
    """Add `count` messages with log times from `first` to `last` [ns]."""
    counts = found.channel_message_counts
    counts[channel] = counts.get(channel, 0) + count
    none_before = found.message_count == 0
    found.message_start_time = first if none_before else min(found.message_start_time, first)
    found.message_end_time = max(found.message_end_time, last)
    found.message_count += count
