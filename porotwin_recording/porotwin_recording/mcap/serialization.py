"""Messages to CDR bytes and back without rclpy, from their definitions."""

import struct
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from porotwin_core.basis.errors import InputError
from porotwin_recording.mcap.definitions import message_definition, types_of

SECOND = 1_000_000_000
"""One second in nanoseconds, the unit of stamps and log times."""

_CDR_ALIGNMENT = 4
"""DDS pads messages to a multiple of this [bytes]."""

_STAMP_OFFSET = 4
"""Position of the stamp in a message that begins with a header [bytes]."""

STAMP_END = _STAMP_OFFSET + struct.calcsize('iI')
"""End of that stamp [bytes]."""

_NUMBERS = frozenset(
    ['float32', 'float64', *(f'{sign}int{bits}' for sign in ('', 'u') for bits in (8, 16, 32, 64))]
)

_WRONG_BYTES = (
    SerdeError,
    LookupError,
    ValueError,
    AssertionError,
    struct.error,
    MemoryError,
    OverflowError,
)
"""Exceptions of rosbags and numpy at bytes that do not follow a definition."""

Field = tuple[Nodetype, Any]
"""Description of a field in rosbags: its kind, and details that depend on the kind."""


class Serializer:
    """Serializes message objects whose definitions are installed."""

    def to_cdr(self, message: Any) -> bytes:
        """Return `message`, an instance of a generated ROS 2 class, as little-endian CDR.

        Raises:
            InputError: the definition of its type is not installed.
        """
        type_name = message_type(message)
        store = types_of(type_name, message_definition(type_name))
        data = bytes(store.serialize_cdr(_converted(message, type_name, store), type_name))
        return data + bytes(-len(data) % _CDR_ALIGNMENT)


def _converted(message: Any, type_name: str, store: Typestore) -> Any:
    """Return the message as an object of the store, which needs arrays in place of lists."""
    _, fields = store.fielddefs[type_name]
    values = {name: _value(getattr(message, name), field, store) for name, field in fields}
    return store.types[type_name](**values)


def _value(value: Any, field: Field, store: Typestore) -> Any:
    kind, detail = field
    if kind == Nodetype.NAME:
        return _converted(value, detail, store)
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        element, _ = detail
        if element[0] == Nodetype.BASE and element[1][0] in _NUMBERS:
            return np.asarray(value, dtype=element[1][0])
        return [_value(item, element, store) for item in value]
    return value


class Deserializer:
    """Reads messages of one recorded type.

    An older recording may lack fields that the type has today. They receive the default values of
    ROS: zero, False, an empty text or an empty sequence. A type without an installed definition
    keeps its recorded fields.

    Raises:
        InputError: the recorded definition cannot be parsed.
    """

    def __init__(self, type_name: str, definition: str) -> None:
        self._type_name = type_name
        self._store = types_of(type_name, definition)
        self._current = _newer_types(type_name, definition)

    def from_cdr(self, data: bytes) -> Any:
        """Return the message in `data`.

        Raises:
            InputError: the bytes do not follow the recorded definition.
        """
        try:
            message = self._store.deserialize_cdr(data, self._type_name)
        except _WRONG_BYTES as error:
            reason = ' '.join(str(error).split()) or type(error).__name__
            raise InputError(f"message is not a '{self._type_name}': {reason}") from None
        if self._current is not None:
            _add_missing_fields(message, self._type_name, self._store, self._current)
        return message


def _newer_types(type_name: str, definition: str) -> Typestore | None:
    """Return the installed types; None if they are not installed or equal to the recorded ones."""
    try:
        installed = message_definition(type_name)
        return None if installed == definition else types_of(type_name, installed)
    except InputError:
        return None


def _add_missing_fields(
    message: Any, type_name: str, recorded: Typestore, current: Typestore
) -> None:
    """Add all fields that `message`, or a message in it, has in `current` but not in `recorded`."""
    known = dict(recorded.fielddefs[type_name][1])
    for name, field in current.fielddefs[type_name][1]:
        if name not in known:
            setattr(message, name, _default(field, current))
        elif known[name] == field:
            nested_type, nested = _nested_messages(getattr(message, name), field)
            for item in nested:
                _add_missing_fields(item, nested_type, recorded, current)


def _nested_messages(value: Any, field: Field) -> tuple[str, list[Any]]:
    """Return the type name and the messages in the value of a field; none for plain values."""
    kind, detail = field
    if kind == Nodetype.NAME:
        return detail, [value]
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) and detail[0][0] == Nodetype.NAME:
        return detail[0][1], list(value)
    return '', []


def _default(field: Field, store: Typestore) -> Any:
    """Return the default value of a field in ROS."""
    kind, detail = field
    if kind == Nodetype.NAME:
        _, fields = store.fielddefs[detail]
        return store.types[detail](**{name: _default(inner, store) for name, inner in fields})
    if kind == Nodetype.BASE:
        base, _ = detail
        return {'string': '', 'wstring': '', 'bool': False}.get(base, 0)
    element, length = detail
    count = length if kind == Nodetype.ARRAY else 0
    if element[0] == Nodetype.BASE and element[1][0] in _NUMBERS:
        return np.zeros(count, dtype=element[1][0])
    return [_default(element, store) for _ in range(count)]


def message_type(message: Any) -> str:
    """Return the type name (pkg/msg/Name) of an instance of a generated ROS 2 class."""
    kind = type(message)
    return f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'


def stamp_of(data: bytes) -> int:
    """Return the stamp [ns] of a CDR message that begins with a header, without decoding it all.

    Raises:
        InputError: the message is shorter than a stamp.
    """
    if len(data) < STAMP_END:
        raise InputError(f'message of {len(data)} bytes has no stamp')
    order = '<' if data[1] & 1 else '>'
    seconds, nanoseconds = struct.unpack_from(f'{order}iI', data, _STAMP_OFFSET)
    return int(seconds) * SECOND + int(nanoseconds)
