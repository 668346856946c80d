"""Effects that a diagnosis found, with the intervals of their parameters."""

import math
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.model.effect_parameter import HALF_INTERVAL, Parameter
from porotwin_solver.effects import effect
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter
from porotwin_solver.effects.definition.effect import Scope
from porotwin_solver.effects.rate import EFFECT as RATE

LEAST_SHARE = 0.1
"""Share of the diagnosed value, counted from the bound of its range, that a drawn one keeps."""


OF_THE_RIG = (Scope.RIG, Scope.WELL, Scope.PLACE)
"""Scopes of effects that siblings can have."""

ASYMMETRY = 1.1
"""Ratio of the two sides of an interval above which it is that of a logarithm."""


def read_diagnosis(path: Path) -> tuple[Candidate, ...]:
    """Return the effects of the rig that the `diagnosis.json` at `path` kept, if any.

    One step of a parameter is its standard deviation.

    Effects of the camera and of the numerical scheme are none: they move no water or tracer. Those
    of a pump are none either: the hub knows its delivery.

    Raises:
        InputError: the file cannot be read, or lacks a key.
    """
    try:
        data = json_value(read_regular(path))
        kept = [item for item in data['effects'] if item['name'] in data['combination']]
        return tuple(
            _diagnosed(item)
            for item in kept
            if effect(item['name']).scope in OF_THE_RIG and item['name'] != RATE.name
        )
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name a diagnosis.json') from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path}: no diagnosis.json ({error!r}); diagnose again') from None


def _diagnosed(item: dict[str, Any]) -> Candidate:
    name = str(item['name'])
    known = effect(name).parameters
    numbers: list[FitParameter] = []
    fixed: dict[str, float | str] = {}
    for key, entry in item['parameters'].items():
        value = entry['value']
        if isinstance(value, str):
            fixed[key] = value
        elif entry['low'] == entry['high']:  # no interval: None, or no width
            fixed[key] = float(value)
        else:
            interval = (float(entry['low']), float(entry['high']))
            numbers.append(_with_doubt(key, known[key], float(value), *interval))
    return Candidate(name, tuple(numbers), fixed)


def _with_doubt(
    name: str, parameter: Parameter, value: float, low: float, high: float
) -> FitParameter:
    """Return a number with its interval of 90 %, from `low` to `high`.

    The diagnosis fits the logarithm of a number known to a factor: its interval is wider
    above. As a plain number half of the siblings would have a hundred times as much.

    Of a parameter that must be greater than a bound, a part of the way from the diagnosed `value`
    to the bound is the least.
    """
    is_log = 0.0 < low < value and high - value > ASYMMETRY * (value - low)
    width = math.log(high / low) if is_log else high - low
    least = parameter.low
    if parameter.above > -math.inf:
        least = max(least, parameter.above + LEAST_SHARE * (value - parameter.above))
    step = width / (2.0 * HALF_INTERVAL)
    return FitParameter(name, parameter.unit, value, step, least, parameter.high, log=is_log)
