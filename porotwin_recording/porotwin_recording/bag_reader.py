"""Reads MCAP bags: single files and rosbag2 folders, complete or cut off by a crash."""

import heapq
import logging
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import yaml

from porotwin_core.errors import InputError
from porotwin_recording.bag_records import BagMessage
from porotwin_recording.bag_writer import METADATA
from porotwin_recording.mcap_reader import merged_topics, open_mcap
from porotwin_recording.serialization import Deserializer

logger = logging.getLogger(__name__)


class BagReader:
    """Reads the bag at `path`: an .mcap file, or a rosbag2 folder with or without metadata.yaml.

    A file without an end, after a crash or a kill, is read up to its last complete chunk; a remark
    and a warning in the log report it.

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
        self._files = [open_mcap(file, self.remark) for file in _files(self.path)]
        self.topics = merged_topics(topic for file in self._files for topic in file.topics.values())
        filled = [file.statistics for file in self._files if file.statistics.message_count]
        self.start_time = min((part.message_start_time for part in filled), default=0)
        self.end_time = max((part.message_end_time for part in filled), default=0)
        self.message_count = sum(part.message_count for part in filled)
        self._deserializers: dict[str, Deserializer] = {}

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
    ) -> Iterator[BagMessage]:
        """Yield messages, ordered by log time; one chunk at a time is in memory.

        Args:
            topics: absolute names; all topics by default.
            start: first log time [ns].
            stop: end of the log times [ns], exclusive.

        Raises:
            InputError: a chunk of the file is damaged.
        """
        streams = [file.messages(topics, start, stop) for file in self._files]
        yield from heapq.merge(*streams, key=lambda message: message.log_time)

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
            raise InputError(f"{self.path}: topic '{message.topic}': {error}") from None


def is_bag(path: Path) -> bool:
    """Return whether `path` is an .mcap file, or a folder with one or with metadata of a bag."""
    if path.is_dir():
        return (path / METADATA).is_file() or any(path.glob('*.mcap'))
    return path.suffix == '.mcap'


def _files(path: Path) -> list[Path]:
    """Return the MCAP files of the bag at `path`.

    A killed recorder leaves no metadata.yaml; then all .mcap files of the folder count.
    """
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
    remedy = f"convert it with 'rosbags-convert --src {path} --dst NEW --dst-storage mcap'"
    if information.get('storage_identifier') != 'mcap':
        raise InputError(f'{path}: is a {information.get("storage_identifier")} bag; {remedy}')
    if str(information.get('compression_mode') or 'none').lower() != 'none':
        raise InputError(f'{path}: is compressed by {information["compression_mode"]}; {remedy}')
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
