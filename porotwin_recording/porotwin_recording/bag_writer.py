"""Writes bags in the format of `ros2 bag`: a folder with metadata.yaml, or one MCAP file."""

import itertools
from pathlib import Path
from typing import Any, Self

import yaml

from porotwin_core.errors import InputError
from porotwin_recording.bag_records import Topic, TopicQos, qos_profiles
from porotwin_recording.definitions import message_definition, type_hash
from porotwin_recording.mcap_writer import McapWriter, OpenFn, new_file

METADATA = 'metadata.yaml'
METADATA_VERSION = 9
"""Version of rosbag2's metadata that ROS 2 Jazzy writes."""


def next_free_path(path: Path) -> Path:
    """Return `path`, or if it exists the first free one of path_2, path_3, ..."""
    stem, suffix = (path.stem, path.suffix) if path.suffix == '.mcap' else (path.name, '')
    numbered = (path.with_name(f'{stem}_{number}{suffix}') for number in itertools.count(2))
    return next(place for place in itertools.chain([path], numbered) if not place.exists())


class BagWriter:
    """Writes a new bag: one file if `path` ends in .mcap, otherwise a rosbag2 folder.

    The bag includes the definition of every message type. `flush` makes all messages so far
    survive the end of this process. The end of the `with` block completes the bag.

    Args:
        path: the bag.
        compress: compress chunks with zstd.
        open_file: creates the MCAP file for unbuffered writing.

    Raises:
        InputError: the path exists already, or cannot be written.
    """

    def __init__(
        self, path: Path | str, *, compress: bool = True, open_file: OpenFn = new_file
    ) -> None:
        self.path = Path(path)
        if self.path.exists():
            raise InputError(f'{self.path}: exists already; name another bag')
        is_file = self.path.suffix == '.mcap'
        folder = self.path.parent if is_file else self.path
        self._folder = None if is_file else folder
        self.file = self.path if is_file else folder / f'{folder.name}_0.mcap'
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._mcap = McapWriter(self.file, compress=compress, open_file=open_file)
        except OSError as error:
            raise InputError(f'{self.path}: cannot be written ({error.strerror})') from None
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._schemas: dict[str, int] = {}

    @property
    def message_count(self) -> int:
        """Number of messages written so far, flushed or not."""
        return self._mcap.message_count

    def add_topic(
        self,
        name: str,
        type_name: str,
        *,
        qos: TopicQos | None = None,
        definition: str | None = None,
    ) -> None:
        """Add the topic `name` (absolute); must precede its messages.

        Args:
            name: absolute name of the topic.
            type_name: message type as pkg/msg/Name.
            qos: quality of service of its publisher.
            definition: definition of the type (ros2msg); the installed one by default.

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
        if type_name not in self._schemas:
            self._schemas[type_name] = self._mcap.add_schema(type_name, definition)
        metadata = {'offered_qos_profiles': yaml.safe_dump(qos_profiles(qos), sort_keys=False)}
        channel = self._mcap.add_channel(name, self._schemas[type_name], metadata)
        self._topics[name] = (channel, Topic(name, type_name, qos, definition))

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
        self._mcap.write(
            self._topics[topic][0],
            data,
            log_time=log_time,
            publish_time=log_time if publish_time is None else publish_time,
            sequence=sequence,
        )

    def flush(self) -> None:
        """Write all messages in memory to disk.

        Raises:
            OSError: the disk refused; all messages stay in memory for the next flush.
        """
        self._mcap.flush()

    def close(self) -> None:
        """Complete the bag.

        Raises:
            OSError: the end could not be written; flushed messages are safe.
        """
        self._mcap.close()
        if self._folder is not None:
            text = yaml.safe_dump(self._metadata(), sort_keys=False)
            partial = self._folder / f'{METADATA}.partial'
            partial.write_text(text, encoding='utf-8')
            partial.replace(self._folder / METADATA)

    def _metadata(self) -> dict[str, Any]:
        information = {
            'version': METADATA_VERSION,
            'storage_identifier': 'mcap',
            **self._extent(),
            'topics_with_message_count': [
                self._topic_metadata(channel, topic) for channel, topic in self._topics.values()
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self.file.name],
            'files': [{'path': self.file.name, **self._extent()}],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }
        return {'rosbag2_bagfile_information': information}

    def _extent(self) -> dict[str, Any]:
        """Return duration, start and number of messages.

        Every call returns new dictionaries: YAML would replace a repeated one by an alias.
        """
        return {
            'duration': {'nanoseconds': self._mcap.end_time - self._mcap.start_time},
            'starting_time': {'nanoseconds_since_epoch': self._mcap.start_time},
            'message_count': self._mcap.message_count,
        }

    def _topic_metadata(self, channel: int, topic: Topic) -> dict[str, Any]:
        return {
            'topic_metadata': {
                'name': topic.name,
                'type': topic.type_name,
                'serialization_format': 'cdr',
                'offered_qos_profiles': qos_profiles(topic.qos),
                'type_description_hash': type_hash(topic.type_name, topic.definition),
            },
            'message_count': self._mcap.message_counts[channel],
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
