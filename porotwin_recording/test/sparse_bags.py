"""Bags that claim many gigabytes of photographs and take no space: their pixels are holes."""

import struct
import zlib
from array import array
from pathlib import Path
from typing import IO

from builtin_interfaces.msg import Time
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
    Statistics,
)
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header as RosHeader

from porotwin_core.conversions import rig_to_msg
from porotwin_core.rig import Rig
from porotwin_recording import topic_names
from porotwin_recording.definitions import message_definition
from porotwin_recording.mcap_writer import MAGIC
from porotwin_recording.serialization import SECOND, Serializer, message_type

START = 1_700_000_000 * SECOND
INTERVAL = 30 * SECOND
JPEG = b'\xff\xd8\xff\xe1'


class SparseBag:
    """Writes an MCAP file with a rig and photographs whose pixels are holes of the file."""

    def __init__(self, path: Path, rig: Rig) -> None:
        self._serializer = Serializer()
        self._index: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._topics: list[McapRecord] = []
        with path.open('xb') as file:
            self._file: IO[bytes] = file
            file.write(MAGIC + _bytes(Header('ros2', 'test')))
        self._path = path
        self._add(topic_names.RIG, rig_to_msg(rig), START)

    def photograph(
        self, number: int, size: int, *, topic: str = topic_names.IMAGE, content: bytes = b''
    ) -> None:
        """Add photograph `number` with a file of `size` bytes.

        It begins with `content`, the file of a JPEG; without, it cannot be decoded.
        """
        stamp = START + number * INTERVAL
        header = RosHeader(stamp=Time(sec=stamp // SECOND), frame_id='camera')
        data = content or JPEG + (number + 1).to_bytes(4, 'big')
        image = CompressedImage(header=header, format='jpeg', data=array('B', data))
        self._add(topic, image, stamp, hole=size - len(data), behind=len(data))

    def message(self, topic: str, message: object, number: int) -> None:
        """Add a small message at the time of photograph `number`."""
        self._add(topic, message, START + number * INTERVAL)

    def _add(
        self, topic: str, message: object, log_time: int, *, hole: int = 0, behind: int = 0
    ) -> None:
        """Add a message; its last `behind` bytes are an array that goes on with a `hole`."""
        data = self._serializer.to_cdr(message)
        if hole:
            place = len(data) - behind - 4
            (length,) = struct.unpack_from('<I', data, place)
            data = data[:place] + struct.pack('<I', length + hole) + data[place + 4 :]
        number, new = self._channel(topic, message_type(message))
        record = _bytes(Message(number, log_time, data, log_time, 0))
        record = record[:1] + struct.pack('<Q', len(record) - 9 + hole) + record[9:]
        records = b''.join(map(_bytes, new)) + record
        chunk = _bytes(Chunk('', records, log_time, log_time, 0, len(records) + hole))
        chunk = bytearray(chunk[: -len(records)])
        struct.pack_into('<Q', chunk, 1, len(chunk) - 9 + len(records) + hole)
        struct.pack_into('<Q', chunk, len(chunk) - 8, len(records) + hole)
        with self._path.open('r+b') as file:
            begin = file.seek(0, 2)
            file.write(chunk + records)
            end = file.seek(hole, 1)
            file.write(_bytes(MessageIndex(number, [(log_time, len(records) - len(record))])))
        self._counts[number] = self._counts.get(number, 0) + 1
        index = ChunkIndex(
            chunk_length=end - begin,
            chunk_start_offset=begin,
            compression='',
            compressed_size=len(records) + hole,
            message_end_time=log_time,
            message_index_length=0,
            message_index_offsets={number: end},
            message_start_time=log_time,
            uncompressed_size=len(records) + hole,
        )
        self._index.append(_bytes(index))
        self._last = log_time

    def _channel(self, topic: str, type_name: str) -> tuple[int, list[McapRecord]]:
        """Return the number of a topic, and the records that make it known."""
        name = f'{topic_names.NAMESPACE}/{topic}'
        for record in self._topics:
            if isinstance(record, Channel) and record.topic == name:
                return record.id, []
        number = len(self._topics) // 2 + 1
        definition = message_definition(type_name).encode()
        new = [
            Schema(number, definition, 'ros2msg', type_name),
            Channel(number, name, 'cdr', {}, number),
        ]
        self._topics += new
        return number, new

    def close(self) -> None:
        """Write the index and the end of the file."""
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._counts),
            channel_message_counts=self._counts,
            chunk_count=len(self._index),
            message_count=sum(self._counts.values()),
            message_end_time=self._last,
            message_start_time=START - INTERVAL,
            metadata_count=0,
            schema_count=len(self._counts),
        )
        with self._path.open('r+b') as file:
            data_end = _bytes(DataEnd(0))
            start = file.seek(0, 2) + len(data_end)
            summary = b''.join(map(_bytes, [*self._topics, statistics])) + b''.join(self._index)
            footer = _bytes(Footer(start, 0, 0))[:-4]
            checksum = zlib.crc32(summary + footer)
            file.write(data_end + summary + footer + struct.pack('<I', checksum) + MAGIC)


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
