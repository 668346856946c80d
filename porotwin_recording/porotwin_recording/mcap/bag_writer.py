"""Writes bags in the format of `ros2 bag`: a folder with metadata.yaml, or one MCAP file."""

import itertools
import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Self

import yaml

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_file import write_whole
from porotwin_recording.mcap.bag_folder import METADATA, mcap_files
from porotwin_recording.mcap.bag_records import Topic, TopicQos, qos_profiles
from porotwin_recording.mcap.definitions import message_definition, type_hash
from porotwin_recording.mcap.mcap_reader import open_mcap
from porotwin_recording.mcap.mcap_writer import McapWriter, OpenFn, new_file
from porotwin_recording.mcap.serialization import SECOND

logger = logging.getLogger(__name__)

METADATA_VERSION = 9
"""Version of rosbag2's metadata that ROS 2 Jazzy writes."""


def _next_file(folder: Path) -> Path:
    """Return the path of the next file of a rosbag2 folder: name_0.mcap, name_1.mcap, ..."""
    files = (folder / f'{folder.name}_{number}.mcap' for number in itertools.count())
    return next(file for file in files if not file.exists())


def next_free_path(path: Path) -> Path:
    """Return `path`, or if it exists the first free one of path_2, path_3, ..."""
    stem, suffix = (path.stem, path.suffix) if path.suffix == '.mcap' else (path.name, '')
    numbered = (path.with_name(f'{stem}_{number}{suffix}') for number in itertools.count(2))
    return next(place for place in itertools.chain([path], numbered) if not place.exists())


@dataclass(frozen=True)
class SplitRule:
    """When a recorder goes on in another file of its folder; 0: never for this reason.

    Attributes:
        size_bytes: size of a file.
        duration_s: time between the first and the last message of a file [s].
    """

    size_bytes: int = 0
    duration_s: float = 0.0

    def ends(self, mcap: McapWriter) -> bool:
        """Return whether the file of `mcap` is full."""
        seconds = (mcap.end_time - mcap.start_time) / SECOND
        full = 0 < self.size_bytes <= mcap.size
        return full or 0.0 < self.duration_s <= seconds


class _Part(NamedTuple):
    """One file of a rosbag2 folder: its name, log times [ns], number of messages and topics."""

    name: str
    start: int
    end: int
    message_count: int
    topics: dict[str, Topic]


class BagWriter:
    """Writes a new bag: one file if `path` ends in .mcap, otherwise a rosbag2 folder.

    The bag includes the definition of every message type. `flush` makes all messages so far
    survive the end of this process. The end of the `with` block completes the bag.

    Args:
        path: the bag.
        compress: compress chunks with zstd.
        extend: if the folder exists, add a file to it, as `ros2 bag` does when it splits a bag.
        split: when to go on in another file of the folder.
        open_file: creates the MCAP file for unbuffered writing.

    Raises:
        InputError: the path exists already, or cannot be written.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        compress: bool = True,
        extend: bool = False,
        split: SplitRule = SplitRule(),
        open_file: OpenFn = new_file,
    ) -> None:
        self.path = Path(path)
        is_file = self.path.suffix == '.mcap'
        if is_file and split != SplitRule():
            raise InputError(f'{self.path}: one file cannot be split; name a folder for the bag')
        extend = extend and not is_file
        if self.path.exists() and not (extend and self.path.is_dir()):
            raise InputError(f'{self.path}: exists already; name another bag')
        folder = self.path.parent if is_file else self.path
        self._folder = None if is_file else folder
        self.file = self.path if is_file else _next_file(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._mcap = McapWriter(self.file, compress=compress, open_file=open_file)
        except OSError as error:
            raise InputError(f'{self.path}: cannot be written ({error.strerror})') from None
        self._new_mcap = partial(McapWriter, compress=compress, open_file=open_file)
        self._split = split
        self._parts: list[_Part] = []
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._schemas: dict[str, int] = {}

    @property
    def readable_count(self) -> int:
        """Number of messages on the disk: they survive the end of this process."""
        return self._mcap.readable_count + sum(part.message_count for part in self._parts)

    @property
    def message_count(self) -> int:
        """Number of messages written so far, flushed or not."""
        return self._mcap.message_count + sum(part.message_count for part in self._parts)

    def add_topic(
        self,
        name: str,
        type_name: str,
        *,
        qos: TopicQos | None = None,
        definition: str | None = None,
        program: str = PROGRAM,
    ) -> None:
        """Add the topic `name` (absolute); must precede its messages.

        Args:
            name: absolute name of the topic.
            type_name: message type as pkg/msg/Name.
            qos: quality of service of its publisher.
            definition: definition of the type (ros2msg); the installed one by default.
            program: name and version of the program that makes its messages; empty: not known.

        Raises:
            InputError: the bag holds this topic with another type, or the type is not installed.
        """
        if name in self._topics:
            known = self._topics[name][1].type_name
            if known != type_name:
                raise InputError(
                    f"topic '{name}' carries '{known}' in {self.path}; '{type_name}' is left out"
                )
            return
        qos = qos or TopicQos()
        definition = message_definition(type_name) if definition is None else definition
        topic = Topic(name, type_name, qos, definition, program=program)
        self._topics[name] = (self._add_channel(topic), topic)

    def _add_channel(self, topic: Topic) -> int:
        """Add a topic to the file that is written; return its number there."""
        kind = topic.type_name
        if kind not in self._schemas:
            self._schemas[kind] = self._mcap.add_schema(kind, topic.definition)
        profiles = yaml.safe_dump(qos_profiles(topic.qos), sort_keys=False)
        metadata = {'offered_qos_profiles': profiles, 'program': topic.program or ''}
        return self._mcap.add_channel(topic.name, self._schemas[kind], metadata)

    def write(
        self,
        topic: str,
        data: bytes,
        *,
        log_time: int,
        publish_time: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Add one serialized message (CDR) to a topic that was added before.

        Args:
            topic: absolute name.
            data: the message.
            log_time: when the recorder received it [ns].
            publish_time: when it was published [ns]; the log time by default.
            sequence: the publisher's count of its messages; 0 if unknown.

        Raises:
            OSError: the disk refused the data; the message stays in memory for the next flush.
        """
        try:
            if self._split.ends(self._mcap):
                self._go_on_in_another_file()
        finally:  # into the full file, if the disk refuses another one
            self._mcap.write(
                self._topics[topic][0],
                data,
                log_time=log_time,
                publish_time=log_time if publish_time is None else publish_time,
                sequence=sequence,
            )

    def _go_on_in_another_file(self) -> None:
        """Complete the file and begin the next one, with the same topics.

        Raises:
            OSError: the disk refused; everything stays where it is.
        """
        assert self._folder is not None
        self._mcap.flush()
        file = _next_file(self._folder)
        following = self._new_mcap(file)
        part = self._own_part()
        try:
            self._mcap.close_if_complete()
        except OSError:
            following.discard(file)
            raise
        self._parts.append(part)
        self.file, self._mcap, self._schemas = file, following, {}
        self._topics = {
            name: (self._add_channel(topic), topic) for name, (_, topic) in self._topics.items()
        }

    def flush(self) -> None:
        """Write all messages in memory to disk.

        Raises:
            OSError: the disk refused; all messages stay in memory for the next flush.
        """
        self._mcap.flush()

    def restore_if_removed(self) -> bool:
        """Write the file again if somebody removed it or its folder; return whether that was so.

        Raises:
            OSError: it cannot be written.
        """
        if self._mcap.is_there(self.file):
            return False
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self._mcap.move_to(self.file)
        return True

    def close(self) -> None:
        """Complete the bag.

        Raises:
            OSError: the end could not be written; flushed messages are safe.
        """
        self.restore_if_removed()
        self._mcap.close()
        if self._folder is not None:
            text = yaml.safe_dump(self._metadata(), sort_keys=False)
            write_whole(self._folder / METADATA, text)

    def _metadata(self) -> dict[str, Any]:
        """Return the content of metadata.yaml: this file, and the earlier ones of the folder."""
        parts = [*self._earlier_parts(), *self._parts, self._own_part()]
        channels = {topic.name: topic for part in parts for topic in part.topics.values()}
        counts = {
            name: sum(part.topics[name].message_count for part in parts if name in part.topics)
            for name in channels
        }
        filled = [part for part in parts if part.message_count]
        start = min((part.start for part in filled), default=0)
        end = max((part.end for part in filled), default=0)
        information = {
            'version': METADATA_VERSION,
            'storage_identifier': 'mcap',
            **_extent(start, end, sum(part.message_count for part in parts)),
            'topics_with_message_count': [
                _topic_metadata(topic, counts[name]) for name, topic in channels.items()
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [part.name for part in parts],
            'files': [
                {'path': part.name, **_extent(part.start, part.end, part.message_count)}
                for part in parts
            ],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }
        return {'rosbag2_bagfile_information': information}

    def _own_part(self) -> _Part:
        written, counts = self._mcap, self._mcap.message_counts
        topics = {
            name: replace(topic, message_count=counts[channel])
            for name, (channel, topic) in self._topics.items()
        }
        return _Part(
            self.file.name, written.start_time, written.end_time, written.message_count, topics
        )

    def _earlier_parts(self) -> Iterator[_Part]:
        assert self._folder is not None
        for file in mcap_files(self._folder):
            if file.name in {self.file.name, *(part.name for part in self._parts)}:
                continue
            try:
                found = open_mcap(file, logger.info)
            except InputError as error:
                logger.warning(str(error))
                continue
            count, first, last = (
                found.statistics.message_count,
                found.statistics.message_start_time,
                found.statistics.message_end_time,
            )
            yield _Part(file.name, first, last, count, found.topics)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _extent(start: int, end: int, count: int) -> dict[str, Any]:
    """Return duration, start and number of messages.

    Every call returns new dictionaries: YAML would replace a repeated one by an alias.
    """
    return {
        'duration': {'nanoseconds': end - start},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': count,
    }


def _topic_metadata(topic: Topic, count: int) -> dict[str, Any]:
    return {
        'topic_metadata': {
            'name': topic.name,
            'type': topic.type_name,
            'serialization_format': 'cdr',
            'offered_qos_profiles': qos_profiles(topic.qos),
            'type_description_hash': type_hash(topic.type_name, topic.definition),
        },
        'message_count': count,
    }
