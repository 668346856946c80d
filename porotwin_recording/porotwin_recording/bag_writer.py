"""A bag as `ros2 bag` writes it: a folder of an MCAP file and metadata.yaml, or the file alone."""

import itertools
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml

from porotwin_core.errors import InputError
from porotwin_recording.definitions import message_definition, type_hash
from porotwin_recording.mcap_writer import McapWriter
from porotwin_recording.topic import Topic, TopicQos, qos_profiles

METADATA = 'metadata.yaml'
METADATA_VERSION = 9
"""Version of rosbag2's metadata that ROS 2 Jazzy writes."""


def free_name(path: Path) -> Path:
    """Return `path`, or where that exists the first of path_2, path_3, ... that does not."""
    stem, suffix = (path.stem, path.suffix) if path.suffix == '.mcap' else (path.name, '')
    later = (path.with_name(f'{stem}_{number}{suffix}') for number in itertools.count(2))
    return next(place for place in itertools.chain([path], later) if not place.exists())


class BagWriter:
    """Writes a new bag: `path` ending in .mcap is one file, any other a rosbag2 folder.

    Every type's definition goes in with it. `flush` makes all messages so far survive the end of
    this process; leaving the `with` block closes the bag.

    Raises:
        InputError: something of that name exists already, or the place cannot be written.
    """

    def __init__(self, path: Path | str, *, compress: bool = True) -> None:
        self.path = Path(path)
        if self.path.exists():
            raise InputError(f'{self.path}: exists already; name another bag')
        is_file = self.path.suffix == '.mcap'
        folder = self.path.parent if is_file else self.path
        self._folder = None if is_file else folder
        self.file = self.path if is_file else folder / f'{folder.name}_0.mcap'
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._mcap = McapWriter(self.file, compress=compress)
        except OSError as error:
            raise InputError(f'{self.path}: cannot be written ({error.strerror})') from None
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._schemas: dict[str, int] = {}

    @property
    def message_count(self) -> int:
        """Number of messages given so far."""
        return self._mcap.message_count

    @property
    def waiting(self) -> int:
        """Size of what the next flush will write [bytes]."""
        return self._mcap.waiting

    def add_topic(
        self,
        name: str,
        type_name: str,
        *,
        qos: TopicQos | None = None,
        definition: str | None = None,
    ) -> None:
        """Add the topic `name` (absolute), which must come before its messages.

        Without a `definition` the installed one of `type_name` (pkg/msg/Name) is taken.

        Raises:
            InputError: the topic is in the bag with another type, or the type is not installed.
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
        """Add one serialized message (CDR) of an added topic; times in [ns].

        Raises:
            OSError: the disk refused; the message waits in memory for the next flush.
        """
        self._mcap.write(
            self._topics[topic][0],
            data,
            log_time=log_time,
            publish_time=log_time if publish_time is None else publish_time,
            sequence=sequence,
        )

    def flush(self) -> None:
        """Write what waits.

        Raises:
            OSError: the disk refused; everything waits in memory for the next flush.
        """
        self._mcap.flush()

    def close(self) -> None:
        """Complete the bag.

        Raises:
            OSError: the end could not be written; what was flushed before is safe.
        """
        self._mcap.close()
        if self._folder is not None:
            text = yaml.safe_dump(self._metadata(), sort_keys=False)
            partial = self._folder / f'{METADATA}.partial'
            partial.write_text(text, encoding='utf-8')
            partial.replace(self._folder / METADATA)

    def _metadata(self) -> dict[str, Any]:
        mcap = self._mcap

        def span() -> dict[str, Any]:
            return {
                'duration': {'nanoseconds': mcap.end_time - mcap.start_time},
                'starting_time': {'nanoseconds_since_epoch': mcap.start_time},
                'message_count': mcap.message_count,
            }

        topics = [
            {
                'topic_metadata': {
                    'name': topic.name,
                    'type': topic.type_name,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': qos_profiles(topic.qos),
                    'type_description_hash': type_hash(topic.type_name, topic.definition),
                },
                'message_count': mcap.message_counts[channel],
            }
            for channel, topic in self._topics.values()
        ]
        information = {
            'version': METADATA_VERSION,
            'storage_identifier': 'mcap',
            **span(),
            'topics_with_message_count': topics,
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self.file.name],
            'files': [{'path': self.file.name, **span()}],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }
        return {'rosbag2_bagfile_information': information}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
