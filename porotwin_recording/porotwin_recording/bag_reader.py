"""Reads MCAP bags, whole or cut off by a crash: single files and rosbag2 folders."""

import heapq
import io
import logging
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Message, Schema, Statistics
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.summary import Summary
from rosbags.typesys.store import Typestore

from porotwin_core.errors import InputError
from porotwin_recording.bag_writer import METADATA
from porotwin_recording.definitions import new_typestore, register_definition
from porotwin_recording.mcap_writer import MAGIC
from porotwin_recording.serialization import from_cdr
from porotwin_recording.topic import Topic, qos_from_yaml

logger = logging.getLogger(__name__)

_DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zstandard.ZstdError,
    UnicodeDecodeError,
    LookupError,
    MemoryError,
)


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One serialized message (CDR) with its times [ns].

    `log_time` is that of the recorder's clock, `publish_time` that of the publisher's computer;
    `sequence` counts the publisher's messages, 0 where nobody counted.
    """

    topic: str
    type_name: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


class BagReader:
    """Reads the bag at `path`: an .mcap file, or a rosbag2 folder, with or without metadata.yaml.

    A file without an end, as a crash or a kill leaves it, gives every whole chunk it holds;
    `remarks` and one warning in the log say so.

    Raises:
        InputError: no bag, no MCAP, or nothing in it can be read.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.remarks: list[str] = []
        self._parts = [_open_part(file, self.remark) for file in _files(self.path)]
        self.topics: dict[str, Topic] = {}
        for part in self._parts:
            for topic in part.topics.values():
                _add_topic(self.topics, topic)
        filled = [part for part in self._parts if part.message_count]
        self.start_time = min((part.start_time for part in filled), default=0)
        self.end_time = max((part.end_time for part in filled), default=0)
        self.message_count = sum(part.message_count for part in filled)
        self._stores: dict[str, Typestore] = {}

    def remark(self, text: str) -> None:
        """Add one line to `remarks` and to the log."""
        self.remarks.append(text)
        logger.warning(text)

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[BagMessage]:
        """Yield the messages of `topics` (all by default) in the order of their log times.

        Only those from `start` on and before `stop` [ns]. Memory holds a chunk at a time.

        Raises:
            InputError: a chunk of the file is damaged.
        """
        streams = [part.messages(topics, start, stop) for part in self._parts]
        yield from heapq.merge(*streams, key=lambda message: message.log_time)

    def decode(self, message: BagMessage) -> Any:
        """Return the message with the fields of the definition that the bag holds for it.

        Raises:
            InputError: the bag holds no definition, or the bytes do not follow it.
        """
        store = self._stores.get(message.topic)
        if store is None:
            topic = self.topics[message.topic]
            if not topic.definition:
                raise InputError(
                    f"{self.path}: holds no definition of '{topic.type_name}'; record it again "
                    'with ./porotwin record'
                )
            store = new_typestore()
            register_definition(store, topic.type_name, topic.definition)
            self._stores[message.topic] = store
        try:
            return from_cdr(store, message.data, message.type_name)
        except InputError as error:
            raise InputError(f"{self.path}: topic '{message.topic}': {error}") from None


def is_bag(path: Path) -> bool:
    """Return whether `path` looks like a bag: an .mcap file, or a folder with one."""
    if path.is_dir():
        return (path / METADATA).is_file() or any(path.glob('*.mcap'))
    return path.suffix == '.mcap'


def _files(path: Path) -> list[Path]:
    """Return the MCAP files of the bag at `path`; a killed recorder leaves no metadata.yaml."""
    if not path.exists():
        raise InputError(f'{path}: no such bag')
    if path.is_file():
        return [path]
    if not (path / METADATA).is_file():
        files = sorted(path.glob('*.mcap'))
        if not files:
            raise InputError(f'{path}: not a bag; it has neither {METADATA} nor an .mcap file')
        return files
    information = _information(path / METADATA)
    mend = f"convert it with 'rosbags-convert --src {path} --dst NEW --dst-storage mcap'"
    if information.get('storage_identifier') != 'mcap':
        raise InputError(f'{path}: is a {information.get("storage_identifier")} bag; {mend}')
    if str(information.get('compression_mode') or 'none').lower() != 'none':
        raise InputError(f'{path}: is compressed by {information["compression_mode"]}; {mend}')
    files = [path / Path(name).name for name in information['relative_file_paths']]
    for file in files:
        if not file.is_file():
            raise InputError(f"{path}: {METADATA} names '{file.name}', which is not there")
    return files


def _information(path: Path) -> dict[str, Any]:
    try:
        information = yaml.safe_load(path.read_text(encoding='utf-8'))
        information = information['rosbag2_bagfile_information']
        if not isinstance(information['relative_file_paths'], list):
            raise TypeError
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError):
        raise InputError(
            f'{path}: not the metadata of a bag; remove it, and the .mcap file is read alone'
        ) from None
    return information


@dataclass(frozen=True)
class _Part:
    """One MCAP file with its index; `end` is where its last whole record ends [bytes]."""

    file: Path
    summary: Summary
    end: int
    whole: bool
    topics: dict[str, Topic]
    message_count: int
    start_time: int
    end_time: int

    def messages(
        self, topics: Collection[str] | None, start: int | None, stop: int | None
    ) -> Iterator[BagMessage]:
        with self.file.open('rb') as stream:
            reader = _Reader(_Bounded(stream, self.end), self.summary)
            found = reader.iter_messages(topics, starting_at=start, ending_before=stop)
            while True:
                try:
                    schema, channel, message = next(found)
                except StopIteration:
                    return
                except _DAMAGE as error:
                    if not self.whole and not self.summary.chunk_indexes:
                        return
                    reason = ' '.join(str(error).split()) or type(error).__name__
                    raise InputError(
                        f"{self.file}: damaged ({reason}); save the rest with 'mcap recover'"
                    ) from None
                yield BagMessage(
                    channel.topic,
                    schema.name if schema else '',
                    message.log_time,
                    message.publish_time,
                    message.sequence,
                    message.data,
                )


class _Bounded(io.RawIOBase):
    """A file that ends at `end`, where what a crash left half-written begins."""

    def __init__(self, stream: IO[bytes], end: int) -> None:
        self._stream = stream
        self._end = end

    def readinto(self, buffer: Any) -> int:
        rest = max(0, self._end - self._stream.tell())
        return self._stream.readinto(memoryview(buffer)[:rest])  # type: ignore[attr-defined]

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._stream.seek(offset, whence)

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True


class _Reader(SeekingReader):
    """A reader that is given its index instead of looking for it at the end of the file."""

    def __init__(self, stream: io.RawIOBase, summary: Summary) -> None:
        super().__init__(stream, validate_crcs=True)  # type: ignore[arg-type]
        self._summary = summary

    def get_summary(self) -> Summary | None:
        return self._summary


def _open_part(file: Path, remark: Callable[[str], None]) -> _Part:
    try:
        with file.open('rb') as stream:
            magic = stream.read(len(MAGIC))
            if magic != MAGIC:
                what = 'empty' if not magic else 'not an MCAP file'
                raise InputError(f'{file}: is {what}; name a bag made by ./porotwin record')
            size = file.stat().st_size
            summary = _index(stream)
            end, whole = size, summary is not None
            if summary is None:
                summary, end = _scan(stream, size)
    except OSError as error:
        raise InputError(f'{file}: cannot be read ({error.strerror})') from None
    statistics = summary.statistics
    assert statistics is not None
    if not whole:
        remark(
            f'{file}: has no end: its recorder still runs or was killed; read the '
            f'{statistics.message_count} messages in its first {end} of {size} bytes'
        )
    topics: dict[str, Topic] = {}
    for channel in summary.channels.values():
        _add_topic(topics, _topic(summary, channel, statistics))
    return _Part(
        file,
        summary,
        end,
        whole,
        topics,
        statistics.message_count,
        statistics.message_start_time,
        statistics.message_end_time,
    )


def _add_topic(topics: dict[str, Topic], topic: Topic) -> None:
    known = topics.get(topic.name)
    count = topic.message_count + (known.message_count if known else 0)
    topics[topic.name] = replace(known or topic, message_count=count)


def _topic(summary: Summary, channel: Channel, statistics: Statistics) -> Topic:
    schema = summary.schemas.get(channel.schema_id)
    return Topic(
        channel.topic,
        schema.name if schema else '',
        qos_from_yaml(channel.metadata.get('offered_qos_profiles', '')),
        schema.data.decode() if schema and schema.encoding == 'ros2msg' else '',
        statistics.channel_message_counts.get(channel.id, 0),
    )


def _index(stream: IO[bytes]) -> Summary | None:
    """Return the index at the end of a whole file, None where there is none to rely on."""
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


def _scan(stream: IO[bytes], size: int) -> tuple[Summary, int]:
    """Return the index of everything whole in a file that lacks its own, and where that ends."""
    summary = Summary()
    statistics = Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)
    summary.statistics = statistics
    position = len(MAGIC)
    while position + 9 <= size:
        stream.seek(position)
        opcode, length = struct.unpack('<BQ', stream.read(9))
        end = position + 9 + length
        if end > size or opcode == Opcode.DATA_END or not 0 < opcode <= max(Opcode):
            break
        try:
            _collect(summary, statistics, stream, opcode, (position, length))
        except _DAMAGE:
            break
        position = end
    return summary, position


def _collect(
    summary: Summary,
    statistics: Statistics,
    stream: IO[bytes],
    opcode: int,
    place: tuple[int, int],
) -> None:
    """Add the record at `place` (offset, length) of the stream to the index."""
    position, length = place
    data = ReadDataStream(stream)
    if opcode == Opcode.SCHEMA:
        _note(summary, statistics, Schema.read(data))
    elif opcode == Opcode.CHANNEL:
        _note(summary, statistics, Channel.read(data))
    elif opcode == Opcode.MESSAGE:
        _note(summary, statistics, Message.read(data, length))
    elif opcode == Opcode.CHUNK:
        chunk = Chunk.read(data)
        channels = set()
        for record in breakup_chunk(chunk, validate_crc=True):
            _note(summary, statistics, record)
            if isinstance(record, Message):
                channels.add(record.channel_id)
        index = ChunkIndex(
            chunk_length=9 + length,
            chunk_start_offset=position,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=0,
            message_index_offsets=dict.fromkeys(channels, 0),
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        summary.chunk_indexes.append(index)


def _note(summary: Summary, statistics: Statistics, record: object) -> None:
    if isinstance(record, Schema):
        summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        summary.channels[record.id] = record
    elif isinstance(record, Message):
        counts = statistics.channel_message_counts
        counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
        first = statistics.message_count == 0
        start = record.log_time if first else min(statistics.message_start_time, record.log_time)
        statistics.message_start_time = start
        statistics.message_end_time = max(statistics.message_end_time, record.log_time)
        statistics.message_count += 1
