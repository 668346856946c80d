"""Validation errors of pydantic as one line for the owner of a rig."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pydantic

from porotwin_core.basis.likely_name import did_you_mean
from porotwin_core.basis.remark import QUOTED, first_of
from porotwin_core.basis.text_with_unit import in_other_unit, was_percent
from porotwin_core.rig.known_keys import KNOWN_KEYS

_FORMS = ('number', 'MapReference', 'DepthPoints', 'DepthPointsFile')
"""Parts of a location that name the form of a value, not a key."""

_FORM = re.compile(r'function-\w+\[|(constrained-)?(tuple|float|dict|list)\[|\[key\]$')
"""Beginnings of further such parts."""

_REASONS = {
    'tuple_type': 'write a list, such as [a, b]',
    'list_type': 'write a list, such as [a, b]',
    'model_type': 'write a section, such as {key: value}',
    'dict_type': 'write a section, such as {key: value}',
    'string_type': 'write a text; put numbers and dates in quotes',
    'float_type': 'write a number',
    'string_too_short': 'write at least one letter',
    'string_pattern_mismatch': 'write one line without control characters',
}
"""Reasons in plain words, by the type of pydantic's error; its own message serves for others."""

_BOUNDS = ('greater_than', 'greater_than_equal', 'less_than', 'less_than_equal')
"""Types of pydantic's errors about a number out of its range; the meaning of the key is added."""

_DECIMAL_COMMA = 'a number with a decimal comma? Write a point, as in 0.39'
"""Guess about a key that is a number: YAML ends the value at the comma."""


def one_line(
    source: Path | str, error: pydantic.ValidationError, *, section: str = 'the description'
) -> str:
    """Return the most useful complaint in `error` as one line.

    Args:
        source: the file or message with the mistake; the line begins with it.
        error: all complaints; unknown keys come first, the keys of the others are added.
        section: name for complaints that concern no single key.
    """
    complaints = sorted(error.errors(), key=lambda item: item['type'] != 'extra_forbidden')
    first, *others = complaints
    parts = _key(first)
    where = '.'.join(parts) or section
    more = _also(where, ['.'.join(_key(other)) or section for other in others])
    reason = _REASONS.get(first['type'], first['msg'].removeprefix('Value error, '))
    if first['type'] == 'extra_forbidden':
        guess = in_other_unit(parts[-1], KNOWN_KEYS) or did_you_mean(parts[-1], KNOWN_KEYS)
        if parts[0] == 'effects' and len(parts) == 3:
            guess = 'an effect has a name and parameters, as docs/effects.md shows'
        if parts[-1].isdigit():
            guess = _DECIMAL_COMMA
        remedy = f'correct or remove it; {guess}' if guess else 'correct or remove it'
        return f"{source}: unknown key '{where}'; {remedy}{more}"
    if first['type'] == 'literal_error' and first['loc'][-1] == '[key]':
        guess = (
            _DECIMAL_COMMA if parts[-1].isdigit() else reason.replace('Input should be', 'write')
        )
        return f"{source}: unknown key '{where}'; {guess}{more}"
    if first['type'] == 'missing' and not parts[-1].isdigit():
        return f"{source}: '{where}' is missing: {KNOWN_KEYS.get(parts[-1], 'needed')}{more}"
    if first['type'] == 'missing':
        return f"{source}: '{'.'.join(parts[:-1])}' has too few values; give the next one{more}"
    if not parts:
        return f'{source}: {reason}{more}'
    if first['type'] in _BOUNDS and (meaning := KNOWN_KEYS.get(parts[-1])):
        reason = f'{reason.replace("Input should be", "write a number")} ({meaning})'
    if (first.get('ctx') or {}).get('le') == 1:
        reason += was_percent(float(first['input']))
    return f'{source}: {where} = {_shown(first["input"])}: {reason}{more}'


def _key(complaint: Mapping[str, Any]) -> list[str]:
    """Return the parts of the key that a complaint is about."""
    parts = [str(part) for part in complaint['loc'] if part not in _FORMS]
    return [part for part in parts if not _FORM.match(part)]


def _also(first: str, others: list[str]) -> str:
    """Return which keys beside the `first` one are wrong, in words."""
    wrong = [key for key in dict.fromkeys(others) if key != first]
    if not wrong:
        return ''
    return f' (also wrong or missing: {first_of(wrong)})'


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= QUOTED else f'{text[:QUOTED]}...'
