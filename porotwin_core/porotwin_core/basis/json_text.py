"""JSON that anybody may have written."""

import json
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
