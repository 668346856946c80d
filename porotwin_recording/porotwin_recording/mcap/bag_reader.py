"""Reads MCAP bags: single files and rosbag2 folders, complete, cut off by a crash, or damaged."""

import heapq
import logging
import tempfile
import weakref
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import zstandard

from porotwin_core.basis.errors import InputError
from porotwin_recording.mcap.bag_folder import (
    COMPRESSED,
    bag_folder,
    is_packed,
    plain_data,
    unpacked,
)
from porotwin_recording.mcap.bag_records import BagMessage
from porotwin_recording.mcap.mcap_reader import NO_HEADS, McapFile, merged_topics, open_mcap
from porotwin_recording.mcap.serialization import Deserializer
from porotwin_recording.mcap.topic_names import DOUBTFUL

logger = logging.getLogger(__name__)


class BagReader:
    """Reads the bag at `path`: an .mcap file, or a rosbag2 folder with or without metadata.yaml.

    Everything readable is read, and a remark and a warning in the log report each loss: a file
    without an end after a crash, a damaged chunk, a file of the folder that is missing. Files in
    zstd compression (`ros2 bag record --compression-mode file`) are unpacked into a temporary
    folder, and messages (`message`) one by one.

    Attributes:
        path: the bag.
        remarks: faults that did not prevent reading, one line each.
        topics: all topics by absolute name.
        start_time: first log time [ns]; 0 without messages.
        end_time: last log time [ns]; 0 without messages.
        message_count: number of messages.

    Raises:
        InputError: not a bag in MCAP format, or not readable.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.remarks: list[str] = []
        self._unpacked = tempfile.TemporaryDirectory(prefix='porotwin-')
        weakref.finalize(self, self._unpacked.cleanup)
        folder = bag_folder(self.path)
        for line in folder.remarks:
            self.remark(line)
        self._files = self._opened(folder.files)
        files = self._files.values()
        self._compressed = folder.messages_compressed or self._begins_packed()
        self.topics = merged_topics(topic for file in files for topic in file.topics.values())
        filled = [file.statistics for file in files if file.statistics.message_count]
        self.start_time = min((part.message_start_time for part in filled), default=0)
        self.end_time = max((part.message_end_time for part in filled), default=0)
        self.message_count = sum(part.message_count for part in filled)
        self._deserializers: dict[str, Deserializer] = {}
        for name, topic in self.topics.items():
            if name.endswith(f'/{DOUBTFUL}') and topic.message_count:
                self.remark(
                    f'{self.path}: {topic.message_count} messages of '
                    f'{name.removesuffix(f"/{DOUBTFUL}")} were set aside when they were recorded, '
                    f'for another program could have sent them; look at them on {name}'
                )

    def _opened(self, paths: list[Path]) -> dict[Path, McapFile]:
        """Return the readable ones of `paths`, by path; remark on the others.

        Raises:
            InputError: none can be read.
        """
        files: dict[Path, McapFile] = {}
        for number, path in enumerate(paths):
            try:
                files[path] = self._opened_file(path, number)
            except InputError as error:
                if number == len(paths) - 1 and not files:
                    raise
                self.remark(f'{error}; the other files of the bag are read')
        return files

    def _opened_file(self, path: Path, number: int) -> McapFile:
        if path.suffix != COMPRESSED:
            return open_mcap(path, self.remark)
        plain = unpacked(path, Path(self._unpacked.name, f'{number}.mcap'))
        return open_mcap(plain, lambda text: self.remark(text.replace(str(plain), str(path))))

    def _begins_packed(self) -> bool:
        """Return whether messages are compressed: a reindex leaves no word about it."""
        file = next(iter(self._files.values()), None)
        if file is None:
            return False
        # the first bytes tell it, and a photograph is large
        heads = dict.fromkeys(file.topics, len(zstandard.FRAME_HEADER))
        first = next(file.messages(None, None, None, heads), None)
        return first is not None and is_packed(first.data)

    def remark(self, text: str) -> None:
        """Add the line `text` to `remarks` and to the log."""
        self.remarks.append(text)
        logger.warning(text)

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int | None = None,
        stop: int | None = None,
        heads: Mapping[str, int] = NO_HEADS,
    ) -> Iterator[BagMessage]:
        """Yield messages, ordered by log time; one chunk at a time is in memory.

        Args:
            topics: absolute names; all topics by default.
            start: first log time [ns].
            stop: end of the log times [ns], exclusive.
            heads: number of first bytes that are enough, by topic; such messages may be cut
                there. So the stamps of large photographs are read without the photographs.

        Raises:
            InputError: a compressed message is damaged.
        """
        heads = NO_HEADS if self._compressed else heads
        streams = [file.messages(topics, start, stop, heads) for file in self._files.values()]
        yield from self._plain(heapq.merge(*streams, key=lambda message: message.log_time))

    def messages_by_file(
        self, topics: Collection[str], heads: Mapping[str, int] = NO_HEADS
    ) -> Iterator[tuple[Path, Iterator[BagMessage]]]:
        """Yield each file of the bag with its messages, as `messages` does."""
        heads = NO_HEADS if self._compressed else heads
        for path, file in self._files.items():
            yield path, self._plain(file.messages(topics, None, None, heads))

    def _plain(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        """Yield messages, unpacked if the bag has them packed."""
        if not self._compressed:
            yield from messages
        for message in messages:
            yield replace(message, data=plain_data(self.path, message.data))

    def decode(self, message: BagMessage) -> Any:
        """Return the message with the fields of its recorded definition.

        Fields that its type has today but had not then receive default values, see `Deserializer`.

        Raises:
            InputError: the bag holds no definition, or the bytes do not follow it.
        """
        if message.topic not in self._deserializers:
            topic = self.topics[message.topic]
            if not topic.definition:
                raise InputError(
                    f"{self.path}: holds no definition of '{topic.type_name}'; record it again "
                    'with ./porotwin record'
                )
            self._deserializers[message.topic] = Deserializer(topic.type_name, topic.definition)
        try:
            return self._deserializers[message.topic].from_cdr(message.data)
        except InputError as error:
            why = str(error).rstrip('.')
            raise InputError(f"{self.path}: topic '{message.topic}': {why}") from None
