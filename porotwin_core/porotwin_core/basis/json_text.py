"""JSON that anybody may have written, and JSON that every program can read."""

import json
import math
from pathlib import Path
from typing import Any


def json_value(text: str | bytes, **options: Any) -> Any:
    """Return what `json.loads` returns.

    Raises:
        ValueError: the text is no JSON, too deep for Python, or holds a number beyond all floats.
    """
    try:
        return json.loads(text, parse_int=_whole_number, **options)
    except RecursionError:
        raise ValueError('brackets in brackets without an end') from None
    except OverflowError:
        raise ValueError('a number with hundreds of digits') from None


def _whole_number(text: str) -> int:
    number = int(text)
    float(number)
    return number


def plain_json(value: Any) -> Any:
    """Return `value` for JSON: paths become text, NaN and infinity become null."""
    if isinstance(value, dict):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
