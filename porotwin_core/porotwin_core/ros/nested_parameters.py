"""Nested values of `rig.yaml` as parameters of ROS 2, whose names have dots: `parts.0.weight`.

A parameter holds one value, or a list of values of one type (rcl_interfaces/ParameterValue).
"""

from collections.abc import Iterator, Mapping
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.remark import QUOTED

VALUE_FIELDS = {
    1: 'bool_value',
    2: 'integer_value',
    3: 'double_value',
    4: 'string_value',
    7: 'integer_array_value',
    8: 'double_array_value',
    9: 'string_array_value',
}
"""The field that holds a value, by the type that ParameterValue names."""

_KINDS = {bool: 1, int: 2, float: 3, str: 4}
_LIST_KINDS = {frozenset({int}): 7, frozenset({str}): 9, frozenset({float}): 8, frozenset(): 8}


def flattened(value: Any, name: str = '') -> Iterator[tuple[str, int, Any]]:
    """Yield the name, the type and the value of every parameter in a nested value of JSON.

    A value of None is left out: it says that the key has its default.
    """
    if type(value) in _KINDS:
        yield name, _KINDS[type(value)], value
        return
    if isinstance(value, list | tuple):
        if {int, float} == set(map(type, value)):
            value = list(map(float, value))
        if kind := _LIST_KINDS.get(frozenset(map(type, value))):
            yield name, kind, list(value)
            return
        value = dict(enumerate(value))
    for key, one in (value or {}).items():
        yield from flattened(one, f'{name}.{key}' if name else str(key))


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `flattened` got, from the values by name; keys 0, 1, ... make a list.

    Raises:
        InputError: a name is both a value and the beginning of other names.
    """
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *path, last = name.split('.')
        branch = tree
        for key in path:
            branch = branch.setdefault(key, {})
            if not isinstance(branch, dict):
                raise InputError(
                    f"rig description: parameter '{name}': '{key}' has a value too; send one"
                )
        branch[last] = value if isinstance(value, str | bool | int | float) else list(value)
    return {key: _with_lists(one) for key, one in tree.items()}


def _with_lists(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    parts = {key: _with_lists(one) for key, one in value.items()}
    if list(parts) == [str(number) for number in range(len(parts))]:
        return list(parts.values())
    return parts


def json_object(text: str) -> dict[str, Any]:
    """Return the parameters in a text of a bag that was recorded before version 0.3.

    Raises:
        InputError: the text is no JSON object.
    """
    try:
        values = json_value(text or '{}')
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise InputError(f"rig description: objective_parameters '{text[:QUOTED]}': no JSON object")
    return values
