"""Reads MCAP files, complete or damaged: a damaged chunk costs its own messages.

Specification: https://mcap.dev/spec. The package `mcap` reads the records. Its readers need the
index at the end of the file and stop at the first damage. Here the index is built again if it is
missing or damaged (`mcap_index`), and every chunk that cannot be read is reported with its
messages.
"""

import contextlib
import heapq
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import IO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Message, MessageIndex, Statistics
from mcap.summary import Summary
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular
from porotwin_recording.mcap.bag_records import BagMessage, Topic, qos_from_yaml
from porotwin_recording.mcap.mcap_index import (
    DAMAGE,
    LARGE_CHUNK,
    NO_PLACE,
    RECORD_HEADER,
    Loss,
    built_index,
    chunk_records,
    chunks_are_there,
    message_heads,
    own_index,
    skimmed_index,
)
from porotwin_recording.mcap.mcap_writer import MAGIC
from porotwin_recording.mcap.serialization import SECOND

NO_HEADS: Mapping[str, int] = MappingProxyType({})
"""Every message is wanted as a whole."""

RemarkFn = Callable[[str], None]
"""Receives one line about a fault that did not prevent reading."""


@dataclass(frozen=True)
class McapFile:
    """One MCAP file with its index.

    Attributes:
        path: the file.
        summary: the index.
        loose: log time [ns] and position [bytes] of the messages outside of chunks.
        topics: its topics by absolute name.
        statistics: number and times of its messages.
        remark: receives one line for every damaged chunk.
    """

    path: Path
    summary: Summary
    loose: list[tuple[int, int]]
    topics: dict[str, Topic]
    statistics: Statistics
    remark: RemarkFn
    _reported: set[int] = field(default_factory=set)

    @cached_property
    def _order(self) -> tuple[list[ChunkIndex], NDArray[np.uint64], NDArray[np.uint64]]:
        """The chunks by their first log times, and their first and last log times [ns]."""
        order = sorted(
            self.summary.chunk_indexes,
            key=lambda index: (index.message_start_time, index.chunk_start_offset),
        )
        starts = np.array([index.message_start_time for index in order], dtype=np.uint64)
        ends = np.array([index.message_end_time for index in order], dtype=np.uint64)
        return order, starts, ends

    def messages(
        self,
        topics: Collection[str] | None,
        start: int | None,
        stop: int | None,
        heads: Mapping[str, int] = NO_HEADS,
    ) -> Iterator[BagMessage]:
        """Yield the messages of `topics` from `start` to before `stop` [ns], by log time.

        None stands for all topics, the first and the last message. The messages of a damaged chunk
        are missing, and `remark` receives one line about them. For the topics in
        `heads` the first bytes of a message are enough; messages in large chunks are cut there.
        """
        channels = {
            number: channel
            for number, channel in self.summary.channels.items()
            if topics is None or channel.topic in topics
        }
        with open_regular(self.path) as stream:
            limits = {number: heads.get(channel.topic) for number, channel in channels.items()}
            chunked = self._chunked(stream, limits, start, stop)
            with open_regular(self.path) as other:
                for message in heapq.merge(
                    chunked, self._outside(other), key=lambda message: message.log_time
                ):
                    inside = (start is None or message.log_time >= start) and (
                        stop is None or message.log_time < stop
                    )
                    if inside and message.channel_id in channels:
                        yield self._bag_message(message, channels[message.channel_id])

    def _bag_message(self, message: Message, channel: Channel) -> BagMessage:
        schema = self.summary.schemas.get(channel.schema_id)
        return BagMessage(
            channel.topic,
            schema.name if schema else '',
            message.log_time,
            message.publish_time,
            message.sequence,
            message.data,
        )

    def _chunked(
        self,
        stream: IO[bytes],
        limits: dict[int, int | None],
        start: int | None,
        stop: int | None,
    ) -> Iterator[Message]:
        """Yield the messages in chunks by log time; chunks may overlap in time.

        `limits` has the channels, and the number of bytes that are enough of their messages.
        """
        waiting: list[tuple[int, int, int, Message]] = []
        for chunk in self._chunks_between(start, stop):
            held = chunk.message_index_offsets
            if held and not any(number in limits for number in held):
                continue
            while waiting and waiting[0][0] < chunk.message_start_time:
                yield heapq.heappop(waiting)[-1]
            for number, message in enumerate(self._wanted_in(stream, chunk, limits)):
                if message.channel_id in limits:
                    entry = (message.log_time, chunk.chunk_start_offset, number, message)
                    heapq.heappush(waiting, entry)
        while waiting:
            yield heapq.heappop(waiting)[-1]

    def _chunks_between(self, start: int | None, stop: int | None) -> Iterator[ChunkIndex]:
        """Yield the chunks with log times from `start` to before `stop` [ns], by their begin."""
        order, starts, ends = self._order
        wanted = np.ones(len(order), dtype=bool)
        if start is not None:
            wanted &= ends >= max(0, start)
        if stop is not None:
            wanted &= starts < max(0, stop)
        return (order[number] for number in np.flatnonzero(wanted))

    def _wanted_in(
        self, stream: IO[bytes], chunk: ChunkIndex, limits: dict[int, int | None]
    ) -> list[Message]:
        """Return the messages of a chunk; those of a large one may be cut at `limits`."""
        held = chunk.message_index_offsets
        if chunk.uncompressed_size > LARGE_CHUNK and NO_PLACE not in held.values():
            limited = {number: limits[number] for number in held if number in limits}
            if any(limit is not None for limit in limited.values()):
                with contextlib.suppress(*DAMAGE):
                    return message_heads(stream, chunk, limited)
        return self._messages_in(stream, chunk)

    def _messages_in(self, stream: IO[bytes], chunk: ChunkIndex) -> list[Message]:
        """Return the messages of a chunk; none if it is damaged."""
        try:
            records = chunk_records(stream, chunk.chunk_start_offset)
        except DAMAGE as error:
            if chunk.chunk_start_offset not in self._reported:
                self._reported.add(chunk.chunk_start_offset)
                loss = Loss(
                    chunk.chunk_start_offset,
                    ' '.join(str(error).split()) or type(error).__name__,
                    chunk.message_start_time,
                    chunk.message_end_time,
                    self._counts(stream, chunk),
                )
                self.remark(loss_line(self.path, loss, self.summary, self.statistics))
            return []
        return [record for record in records if isinstance(record, Message)]

    def _counts(self, stream: IO[bytes], chunk: ChunkIndex) -> dict[int, int]:
        """Return the number of messages by channel in a chunk, from the indexes behind it."""
        counts = {}
        for channel, position in chunk.message_index_offsets.items():
            try:
                stream.seek(position + RECORD_HEADER.size)
                index = MessageIndex.read(ReadDataStream(stream))
            except DAMAGE:
                continue
            if index.channel_id == channel:
                counts[channel] = len(index.records)
        return counts

    def _outside(self, stream: IO[bytes]) -> Iterator[Message]:
        """Yield the messages outside of chunks by log time."""
        for _, position in sorted(self.loose):
            stream.seek(position)
            opcode, length = RECORD_HEADER.unpack(stream.read(RECORD_HEADER.size))
            assert opcode == Opcode.MESSAGE
            yield Message.read(ReadDataStream(stream), length)


def loss_line(path: Path, loss: Loss, summary: Summary, statistics: Statistics) -> str:
    """Return one line that says what a damaged part of a file has cost."""

    def topic(number: int) -> str:
        channel = summary.channels.get(number)
        return channel.topic if channel else 'a topic whose name is lost'

    held = [f'{count} messages on {topic(number)}' for number, count in loss.counts.items()]
    first = statistics.message_start_time
    span = ''
    if loss.start_time and first <= loss.start_time:
        begin, end = ((time - first) / SECOND for time in (loss.start_time, loss.end_time))
        span = f' between {begin:.1f} and {end:.1f} s'
    text = ', '.join(held) or 'an unknown number of messages'
    return f'{path}: damaged at byte {loss.position} ({loss.reason}); lost: {text}{span}'


def open_mcap(path: Path, remark: RemarkFn) -> McapFile:
    """Return the MCAP file at `path`; `remark` receives one line for every loss.

    Raises:
        InputError: the file is empty, no MCAP file, or cannot be read.
    """
    try:
        with open_regular(path) as stream:
            magic = stream.read(len(MAGIC))
            if magic != MAGIC:
                fault = 'empty' if not magic else 'not an MCAP file'
                raise InputError(f'{path}: is {fault}; name a bag made by ./porotwin record')
            size = os.fstat(stream.fileno()).st_size
            own = own_index(stream, size)
            if own is None or _needs_scan(stream, own):
                summary, loose = _scanned(path, stream, size, remark, own)
            else:
                summary, loose = own, []
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror})') from None
    statistics = summary.statistics
    assert statistics is not None
    topics = merged_topics(
        _topic(summary, channel, statistics) for channel in summary.channels.values()
    )
    return McapFile(path, summary, loose, topics, statistics, remark)


def _scanned(
    path: Path, stream: IO[bytes], size: int, remark: RemarkFn, own: Summary | None
) -> tuple[Summary, list[tuple[int, int]]]:
    """Return the index from a look at the whole file, and the messages outside of chunks."""
    built = skimmed_index(stream, size) or built_index(stream, size, own)
    statistics = built.statistics
    for loss in built.losses:
        remark(loss_line(path, loss, built.summary, statistics))
    unnamed = {
        number: count
        for number, count in statistics.channel_message_counts.items()
        if number not in built.summary.channels
    }
    if unnamed:
        total = sum(unnamed.values())
        statistics.message_count -= total
        remark(f'{path}: {total} messages lost, because the names of their topics are damaged')
    count = statistics.message_count
    if built.behind is not None:
        remark(
            f'{path}: another MCAP file begins at its byte {built.behind} and is not read; write '
            f"both into one folder: 'head -c {built.behind}' and 'tail -c +{built.behind + 1}'"
        )
    elif not built.has_end:
        remark(
            f'{path}: has no end, because its recorder is running or was killed; '
            f'{count} messages are in its first {built.end} of {size} bytes'
        )
    elif own is None:
        remark(f'{path}: its index is damaged; {count} messages were found without it')
    return built.summary, built.loose


def _needs_scan(stream: IO[bytes], own: Summary) -> bool:
    """Return whether the index does not lead to all messages."""
    assert own.statistics is not None
    unchunked = own.statistics.message_count > 0 and not own.chunk_indexes
    return unchunked or not chunks_are_there(stream, own)


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
        schema.data.decode(errors='replace') if schema and schema.encoding == 'ros2msg' else '',
        statistics.channel_message_counts.get(channel.id, 0),
        channel.metadata.get('program'),
        channel.metadata.get('pauses_min', ''),
    )
