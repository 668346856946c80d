"""Effects and their parameters in words and laboratory units.

The words of each effect are in its module (`porotwin_solver.effects`).
"""

import math
from collections.abc import Mapping
from typing import Any

from porotwin_core.basis import units
from porotwin_diagnosis.data.sample import Sample
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Scope
from porotwin_solver.effects.definition.words import MOST_PERCENT, number, reading

DIGITS = 3
"""Most significant digits of a fitted parameter, in the sentence and in the table alike."""

ROUGH_DIGITS = 2
"""Significant digits of a parameter without an interval: nobody knows how exact it is."""

MOST_DECIMALS = 5
"""Intervals that need more decimals are written with powers of ten."""

COORDINATES = {'x', 'z'}
"""Places, which are written to the millimetre at most."""


def spoken(name: str) -> str:
    """Return the name of an effect or parameter with spaces."""
    return name.replace('_', ' ')


def spoken_label(label: str) -> str:
    """Return the label of a fit in words, such as `wrong rate of water_in + dispersion`.

    Names of wells stay as rig.yaml spells them.
    """
    return ' + '.join(map(_spoken_member, label.split(' + ')))


def _spoken_member(label: str) -> str:
    """Return the label of one candidate in words; behind its effect is a well or a variant."""
    name, _, rest = label.partition(' ')
    if name not in EFFECTS or not rest:
        return spoken(label)
    if EFFECTS[name].scope is Scope.WELL:
        return at_well(name, rest)
    return f'{spoken(name)} ({rest})'


def at_well(effect: str, well: str) -> str:
    """Return an effect in words, with its well if it has one."""
    return f'wrong {spoken(effect)} of {well}' if well else spoken(effect)


def value(effect: str, parameter: str, amount: float, digits: int = DIGITS) -> str:
    """Return `amount` of a parameter of `effect` in the unit of the report."""
    factor, unit = reading(EFFECTS[effect].parameters[parameter])
    return f'{number(factor * amount, digits)} {unit}'.strip()


def interval(effect: str, parameter: str, entry: Mapping[str, Any]) -> tuple[str, str]:
    """Return the value and the 90 % interval of a parameter of `effect`.

    Both are written to two digits of the interval's width, but to `DIGITS` significant digits at
    most, as the phrase of the effect is. The interval is empty where it is not known.

    Args:
        effect: name of the effect.
        parameter: name of its parameter.
        entry: the parameter in `diagnosis.json`: `value`, `low`, `high`.
    """
    amount = entry['value']
    if isinstance(amount, str):
        return amount, ''
    factor, unit = reading(EFFECTS[effect].parameters[parameter])
    ends = [factor * end for end in (entry.get('low'), entry.get('high')) if end is not None]
    decimals = _decimals(effect, parameter, entry)
    if decimals is None:
        span = f'{" … ".join(map(number, sorted(ends)))} {unit}' if len(set(ends)) == 2 else ''
        return value(effect, parameter, amount), span.strip()
    texts = [_fixed(part, decimals) for part in sorted(ends)]
    middle = f'{_fixed(factor * amount, decimals)} {unit}'
    return middle.strip(), f'{" … ".join(texts)} {unit}'.strip()


def _decimals(effect: str, parameter: str, entry: Mapping[str, Any]) -> int | None:
    """Return the decimals of a parameter in the unit of the report, see `interval`.

    They are negative where the digits before the point are too many. None: its interval is not
    known, or it needs powers of ten.
    """
    if entry.get('low') is None or entry.get('high') is None or entry['low'] == entry['high']:
        return None
    factor = reading(EFFECTS[effect].parameters[parameter]).factor
    low, high, middle = (factor * entry[key] for key in ('low', 'high', 'value'))
    by_width = max(1 - _exponent(abs(high - low)), 0)
    if by_width > MOST_DECIMALS:
        return None
    by_size = DIGITS - 1 - _exponent(abs(middle)) if middle else by_width
    decimals = min(by_width, 0 if parameter in COORDINATES else by_size)
    return decimals if round(low, decimals) != round(high, decimals) else by_width


def _exponent(amount: float) -> int:
    """Return the power of ten of the first digit of `amount`."""
    return math.floor(math.log10(amount))


def _fixed(amount: float, decimals: int) -> str:
    """Return `amount` with fixed decimals and a real minus sign, which zero never has."""
    return f'{round(amount, decimals):z.{max(decimals, 0)}f}'.replace('-', '−')


def _stated(effect: str, parameter: str, entry: Mapping[str, Any]) -> float | str:
    """Return a parameter of `effect` as the table states it."""
    if isinstance(entry['value'], str):
        return entry['value']
    decimals = _decimals(effect, parameter, entry)
    if decimals is None:
        known = entry.get('low') is not None and entry.get('high') is not None
        amount = float(entry['value'])
        return amount if known else _roughly(effect, parameter, amount)
    factor = reading(EFFECTS[effect].parameters[parameter]).factor
    # a size that rounds to nothing stays: its sign chooses the words
    return round(factor * entry['value'], decimals) / factor or float(entry['value'])


def _roughly(effect: str, parameter: str, amount: float) -> float:
    """Return an amount without an interval, to `ROUGH_DIGITS` in the unit of the report.

    A factor near 1 is rounded in its difference from 1. Places stay as they are.
    """
    described = EFFECTS[effect].parameters[parameter]
    if parameter in COORDINATES or not amount:
        return amount
    if described.neutral == 1.0 and 1 / MOST_PERCENT < amount < MOST_PERCENT:
        return 1.0 + _rounded(amount - 1.0)
    factor = reading(described).factor
    return _rounded(factor * amount) / factor


def _rounded(amount: float) -> float:
    """Return `amount` to `ROUGH_DIGITS` significant digits."""
    return float(f'{amount:.{ROUGH_DIGITS}g}')


def phrase(effect: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the phrase of `effect` with its `parameters` of `diagnosis.json`.

    The numbers are rounded as in the table, see `interval`. If some intervals hold the value of no
    effect and others do not, the phrase says which.
    """
    values = {key: _stated(effect, key, entry) for key, entry in parameters.items()}
    words = EFFECTS[effect].phrase(values)
    known = [key for key, entry in parameters.items() if entry.get('low') is not None]
    neutral = {key: EFFECTS[effect].parameters[key].neutral for key in known}
    doubted = [
        f'{spoken(key)} {number(neutral[key])}'
        for key in known
        if parameters[key]['low'] <= neutral[key] <= parameters[key]['high']
    ]
    return f'{words} (perhaps {", ".join(doubted)})' if 0 < len(doubted) < len(known) else words


def percent(share: float) -> str:
    """Return `share` in per cent, to one decimal."""
    return units.percent(share, 1)


def closed(errors: Mapping[str, float]) -> str:
    """Return the share of the gap that closes, with its interval."""
    ends = ('gap_closed', 'gap_closed_low', 'gap_closed_high')
    middle, low, high = (100 * min(max(0.0, errors[end]), 1.0) for end in ends)
    return f'{middle:.0f} % ({low:.0f} … {high:.0f} %)'


def origin(name: str) -> str:
    """Return whether the effect `name` belongs to the camera, to the model or to the rig."""
    scope = EFFECTS[name].scope
    return scope.value if scope in (Scope.CAMERA, Scope.MODEL) else 'rig'


def inputs(sample: Sample) -> str:
    """Return the inputs of the simulations of `sample` in words."""
    rates = 'the rates of the pumps'
    return rates if sample.initial is None else f'{rates} and the tracer of the first map'
