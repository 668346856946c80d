"""Validation errors of pydantic as one line for the owner of a rig."""

import difflib
from pathlib import Path

import pydantic

from porotwin_core.rig.known_keys import KNOWN_KEYS

_FORMS = ('number', 'MapReference', 'DepthPoints', 'DepthPointsFile')
"""Parts of a location that name the form of a value, not a key."""

_REASONS = {
    'tuple_type': 'write a list, such as [a, b]',
    'list_type': 'write a list, such as [a, b]',
    'model_type': 'write a section, such as {key: value}',
    'dict_type': 'write a section, such as {key: value}',
    'string_type': 'write a text; put numbers and dates in quotes',
    'float_type': 'write a number',
    'string_too_short': 'write at least one letter',
}
"""Reasons in plain words, by the type of pydantic's error; its own message serves for others."""

LONGEST_VALUE = 60
"""Longest text of a wrong value in a message [characters]."""


def one_line(
    source: Path | str, error: pydantic.ValidationError, *, section: str = 'the description'
) -> str:
    """Return the most useful complaint in `error` as one line.

    Args:
        source: the file or message with the mistake; the line begins with it.
        error: all complaints; unknown keys come first, the number of others is added.
        section: name for complaints that concern no single key.
    """
    first = min(error.errors(), key=lambda item: item['type'] != 'extra_forbidden')
    parts = [str(part) for part in first['loc'] if part not in _FORMS]
    where = '.'.join(parts) or section
    more = f' (and {error.error_count() - 1} more)' if error.error_count() > 1 else ''
    reason = _REASONS.get(first['type'], first['msg'].removeprefix('Value error, '))
    if first['type'] == 'extra_forbidden':
        near = difflib.get_close_matches(parts[-1], KNOWN_KEYS, n=1)
        guess = f"; did you mean '{near[0]}'?" if near else ''
        return f"{source}: unknown key '{where}'; correct or remove it{guess}{more}"
    if first['type'] == 'missing' and not parts[-1].isdigit():
        return f"{source}: '{where}' is missing: {KNOWN_KEYS.get(parts[-1], 'needed')}{more}"
    if first['type'] == 'missing':
        return f"{source}: '{'.'.join(parts[:-1])}' has too few values; give the next one{more}"
    if not parts:
        return f'{source}: {reason}{more}'
    return f'{source}: {where} = {_shown(first["input"])}: {reason}{more}'


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f'{text[:LONGEST_VALUE]}...'
