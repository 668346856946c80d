"""Effects and their parameters in words and laboratory units.

The words of each effect are in its module (`porotwin_solver.effects`).
"""

import html
import math
from collections.abc import Mapping
from typing import Any

from porotwin_diagnosis.data.sample import Sample
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number, reading

MOST_DECIMALS = 5
"""Intervals that need more decimals are written with powers of ten."""


def spoken(name: str) -> str:
    """Return the name of an effect or parameter with spaces."""
    return name.replace('_', ' ')


def value(effect: str, parameter: str, amount: float, digits: int = 3) -> str:
    """Return `amount` of a parameter of `effect` in the unit of the report, as HTML."""
    factor, unit = reading(EFFECTS[effect].parameters[parameter])
    return f'{number(factor * amount, digits)} {unit}'.strip()


def interval(effect: str, parameter: str, entry: Mapping[str, Any]) -> tuple[str, str]:
    """Return the value and the 90 % interval of a parameter of `effect`, as HTML.

    Both are written to two digits of the interval's width. The interval is empty where it is not
    known.

    Args:
        effect: name of the effect.
        parameter: name of its parameter.
        entry: the parameter in `diagnosis.json`: `value`, `low`, `high`.
    """
    amount = entry['value']
    if isinstance(amount, str):
        return html.escape(amount), ''
    low, high = entry.get('low'), entry.get('high')
    if low is None or high is None or low == high:
        return value(effect, parameter, amount), ''
    factor, unit = reading(EFFECTS[effect].parameters[parameter])
    low, high = sorted((factor * low, factor * high))
    decimals = 1 - math.floor(math.log10(high - low))
    if decimals > MOST_DECIMALS:
        span = f'{number(low)} … {number(high)} {unit}'.strip()
        return value(effect, parameter, amount), span
    texts = [_fixed(part, max(decimals, 0)) for part in (low, high)]
    middle = f'{_fixed(factor * amount, max(decimals, 0))} {unit}'
    return middle.strip(), f'{" … ".join(texts)} {unit}'.strip()


def _fixed(amount: float, decimals: int) -> str:
    """Return `amount` with fixed decimals and a real minus sign, which zero never has."""
    return f'{amount:z.{decimals}f}'.replace('-', '−')


def phrase(effect: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the phrase of `effect` with its `parameters` of `diagnosis.json`, as HTML.

    If some intervals hold the value of no effect and others do not, the phrase says which.
    """
    values = {
        key: html.escape(entry['value']) if isinstance(entry['value'], str) else entry['value']
        for key, entry in parameters.items()
    }
    words = EFFECTS[effect].phrase(values)
    known = [key for key, entry in parameters.items() if entry.get('low') is not None]
    neutral = {key: EFFECTS[effect].parameters[key].neutral for key in known}
    doubted = [
        f'{spoken(key)} {number(neutral[key])}'
        for key in known
        if parameters[key]['low'] <= neutral[key] <= parameters[key]['high']
    ]
    return f'{words} (perhaps {", ".join(doubted)})' if 0 < len(doubted) < len(known) else words


def inputs(sample: Sample) -> str:
    """Return the inputs of the simulations of `sample` in words."""
    rates = 'the rates of the pumps'
    return rates if sample.initial is None else f'{rates} and the tracer of the first map'
