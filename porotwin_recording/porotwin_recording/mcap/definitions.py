"""Definitions of message types. A bag holds them and needs no ROS installation to be read."""

import os
import re
import sys
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from porotwin_core.basis.errors import InputError

_PRIMITIVES = frozenset(
    ['bool', 'byte', 'char', 'string', 'wstring', 'float32', 'float64']
    + [f'{sign}int{bits}' for sign in ('', 'u') for bits in (8, 16, 32, 64)]
)
_FIELD = re.compile(r'^(?P<type>[A-Za-z][\w/]*)(<=\d+)?(\[(<=)?\d*\])?\s+[A-Za-z]\w*')
_SEPARATOR = '=' * 80


def _folders() -> Iterator[Path]:
    """Yield the folders of installed packages, then the one of the source tree."""
    for prefix in (*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix):
        if prefix:
            yield Path(prefix) / 'share'
    yield Path(__file__).resolve().parents[3]


@cache
def _own_definition(type_name: str) -> str | None:
    package, _, name = type_name.split('/')
    for folder in _folders():
        path = folder / package / 'msg' / f'{name}.msg'
        if path.is_file():
            return path.read_text(encoding='utf-8')
    return None


def _field_types(definition: str, package: str) -> Iterator[str]:
    for line in definition.splitlines():
        field = _FIELD.match(line.split('#')[0].strip())
        if field is None or field['type'] in _PRIMITIVES:
            continue
        parts = field['type'].split('/')
        yield f'{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}'


@cache
def message_definition(type_name: str) -> str:
    """Return the definition of `type_name` (pkg/msg/Name), including all nested types.

    The format is ros2msg, with comments: units and conventions become part of the bag.

    Raises:
        InputError: a definition is not installed.
    """
    texts: dict[str, str] = {}
    waiting = [type_name]
    while waiting:
        current = waiting.pop(0)
        if current in texts:
            continue
        text = _own_definition(current)
        if text is None:
            raise InputError(
                f"message type '{current}' is not installed here; source the workspace that has it"
            )
        texts[current] = text
        waiting += _field_types(text, current.split('/')[0])
    first, *rest = texts.items()
    parts = [first[1]]
    for name, text in rest:
        package, _, short = name.split('/')
        parts.append(f'{_SEPARATOR}\nMSG: {package}/{short}\n{text}')
    return '\n'.join(part.rstrip('\n') for part in parts) + '\n'


def register_definition(store: Typestore, type_name: str, definition: str) -> None:
    """Add the types in `definition` to `store`, except those that it holds already.

    Raises:
        InputError: the definition cannot be parsed.
    """
    try:
        types = get_types_from_msg(definition, type_name)
        store.register({name: fields for name, fields in types.items() if name not in store.types})
    except TypesysError as error:
        raise InputError(
            f"definition of '{type_name}' is not valid: {' '.join(str(error).split())}"
        ) from None


def new_typestore() -> Typestore:
    """Return an empty store of message types."""
    return get_typestore(Stores.EMPTY)


@lru_cache(maxsize=128)
def types_of(type_name: str, definition: str) -> Typestore:
    """Return the types in `definition`. Callers share the store and must not add types to it.

    rosbags needs 10 ms and more to parse a definition, and every bag holds the same ones.

    Raises:
        InputError: the definition cannot be parsed.
    """
    store = new_typestore()
    register_definition(store, type_name, definition)
    return store


@cache
def type_hash(type_name: str, definition: str) -> str:
    """Return the RIHS01 hash of a message definition (REP-2016).

    ROS 2 compares these hashes to detect different versions of an interface.

    Raises:
        InputError: the definition cannot be parsed.
    """
    return types_of(type_name, definition).hash_rihs01(type_name)
