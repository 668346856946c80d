"""Messages to CDR bytes and back without rclpy, by their definitions."""

import struct
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from porotwin_core.errors import InputError
from porotwin_recording.definitions import message_definition, new_typestore, register_definition

SECOND = 1_000_000_000
"""One second in the nanoseconds of stamps and log times."""

_NUMBERS = frozenset(
    ['float32', 'float64', *(f'{sign}int{bits}' for sign in ('', 'u') for bits in (8, 16, 32, 64))]
)


class Serializer:
    """Serializes message objects whose definitions are installed."""

    def __init__(self) -> None:
        self._store = new_typestore()

    def to_cdr(self, message: Any) -> bytes:
        """Return `message`, an instance of a generated ROS 2 class, as little-endian CDR.

        Filled up to a multiple of four bytes, as it arrives over DDS.
        """
        type_name = message_type(message)
        if type_name not in self._store.types:
            register_definition(self._store, type_name, message_definition(type_name))
        data = bytes(self._store.serialize_cdr(self._own(message, type_name), type_name))
        return data + bytes(-len(data) % 4)

    def _own(self, message: Any, type_name: str) -> Any:
        """Return the message as an object of the store, which wants arrays where ROS has lists."""
        _, fields = self._store.fielddefs[type_name]
        values = {
            name: self._value(getattr(message, name), description) for name, description in fields
        }
        return self._store.types[type_name](**values)

    def _value(self, value: Any, description: Any) -> Any:
        kind, detail = description
        if kind == Nodetype.NAME:
            return self._own(value, detail)
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            element, _ = detail
            if element[0] == Nodetype.BASE and element[1][0] in _NUMBERS:
                return np.asarray(value, dtype=element[1][0])
            return [self._value(item, element) for item in value]
        return value


def message_type(message: Any) -> str:
    """Return the name (pkg/msg/Name) of the type of an instance of a generated ROS 2 class."""
    kind = type(message)
    return f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'


def from_cdr(store: Typestore, data: bytes, type_name: str) -> Any:
    """Return the message in `data`, with the fields of its definition in `store`.

    Raises:
        InputError: the bytes are not such a message.
    """
    try:
        return store.deserialize_cdr(data, type_name)
    except (SerdeError, KeyError) as error:
        raise InputError(f"message is not a '{type_name}': {error}") from None


def stamp_of(data: bytes) -> int:
    """Return the stamp [ns] of a message (CDR) that begins with a header, without decoding it all.

    Raises:
        InputError: the message is shorter than a stamp.
    """
    if len(data) < 12:
        raise InputError(f'message of {len(data)} bytes has no stamp')
    order = '<' if data[1] & 1 else '>'
    seconds, nanoseconds = struct.unpack_from(f'{order}iI', data, 4)
    return int(seconds) * SECOND + int(nanoseconds)
