"""Numbers of `rig.yaml`: texts, decimal commas and yes/no are refused by name.

A rate or a level may be a text with its unit.
"""

import math
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema

from porotwin_core.basis.text_with_unit import (
    LENGTH_WORDS,
    RATE_WORDS,
    length_in_m,
    plain_number,
    rate_in_ml_h,
)


def _as_number(value: Any) -> Any:
    """Return `value` as a number; a text or a truth value raises ValueError."""
    return _number(value, 'write the number alone; its unit is a part of the name of the key')


def _number(value: Any, remedy: str) -> Any:
    """Return `value` as a number; a text raises ValueError with the `remedy`."""
    if isinstance(value, bool):
        raise ValueError('write a number; yes, no, true and false are none')  # noqa: TRY004
    if not isinstance(value, str):
        return value
    number = plain_number(value)
    if not math.isnan(number):
        return number
    if math.isnan(plain_number(value.replace(',', '.'))):
        raise ValueError(remedy)
    raise ValueError('write a decimal point instead of the comma')


def _as_rate(value: Any) -> Any:
    """Return the rate [ml/h] of a text with a unit, such as 2 l/d, or of a number.

    pydantic 2.5 runs one function before a field, this one, and drops `_as_number`.
    """
    rate = rate_in_ml_h(value) if isinstance(value, str) else None
    return _number(value, RATE_WORDS) if rate is None else rate


def _as_length(value: Any) -> Any:
    """Return the length [m] of a text with a unit, such as 48 cm, or of a number."""
    length = length_in_m(value) if isinstance(value, str) else None
    return _number(value, LENGTH_WORDS) if length is None else length


Number = Annotated[float, BeforeValidator(_as_number), Field(allow_inf_nan=False)]
"""A finite number."""

Positive = Annotated[Number, Field(gt=0)]
"""A finite number above zero."""

NotNegative = Annotated[Number, Field(ge=0)]
"""A finite number, zero or more."""

Share = Annotated[Number, Field(ge=0, le=1)]
"""A number from 0 to 1."""

PositiveShare = Annotated[Number, Field(gt=0, le=1)]
"""A number above 0, at most 1."""

_NUMBER_OR_TEXT = {'type': ['number', 'string']}
"""A number with a unit, for editors."""

Level = Annotated[Number, BeforeValidator(_as_length), WithJsonSchema(_NUMBER_OR_TEXT)]
"""A finite height [m], or a text with its unit."""

Rate = Annotated[Number, BeforeValidator(_as_rate), WithJsonSchema(_NUMBER_OR_TEXT)]
"""A finite rate [ml/h], or a text with its unit."""

PositiveRate = Annotated[
    Positive,
    BeforeValidator(_as_rate),
    WithJsonSchema(_NUMBER_OR_TEXT | {'exclusiveMinimum': 0}),
]
"""A rate above zero [ml/h]."""

NotNegativeRate = Annotated[
    NotNegative, BeforeValidator(_as_rate), WithJsonSchema(_NUMBER_OR_TEXT | {'minimum': 0})
]
"""A rate of zero or more [ml/h]."""
