"""Validation errors of pydantic as one line for the owner of a rig."""

import difflib
from pathlib import Path

import pydantic

_FORMS = ('number', 'MapReference', 'DepthPoints', 'DepthPointsFile')
"""Parts of a location that name the form of a value, not a key."""

LONGEST_VALUE = 60
"""Longest text of a wrong value in a message [characters]."""


def one_line(
    source: Path | str,
    error: pydantic.ValidationError,
    *,
    section: str = 'the description',
    keys: dict[str, str] | None = None,
) -> str:
    """Return the most telling complaint of `error` as one line.

    Args:
        source: the file or message with the mistake; the line begins with it.
        error: all complaints; unknown keys come first, the number of others is added.
        section: the name of the whole, for complaints about no single key.
        keys: the known keys with their meaning, to guess a misspelt one and explain a missing one.
    """
    known = keys or {}
    first = min(error.errors(), key=lambda item: item['type'] != 'extra_forbidden')
    parts = [str(part) for part in first['loc'] if part not in _FORMS]
    where = '.'.join(parts) or section
    more = f' (and {error.error_count() - 1} more)' if error.error_count() > 1 else ''
    reason = first['msg'].removeprefix('Value error, ')
    if first['type'] == 'extra_forbidden':
        near = difflib.get_close_matches(parts[-1], known, n=1)
        guess = f"; did you mean '{near[0]}'?" if near else ''
        return f"{source}: unknown key '{where}'; correct or remove it{guess}{more}"
    if first['type'] == 'missing' and not parts[-1].isdigit():
        return f"{source}: '{where}' is missing: {known.get(parts[-1], 'needed')}{more}"
    if first['type'] == 'missing':
        return f"{source}: '{'.'.join(parts[:-1])}' has too few values; give the next one{more}"
    if not parts:
        return f'{source}: {reason}{more}'
    return f'{source}: {where} = {_shown(first["input"])}: {reason}{more}'


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f'{text[:LONGEST_VALUE]}...'
