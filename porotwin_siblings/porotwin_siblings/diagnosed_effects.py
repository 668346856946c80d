"""Effects that a diagnosis found, with the intervals of their parameters."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.model.effect_parameter import Parameter
from porotwin_core.rig import EffectDescription
from porotwin_solver.effects import effect
from porotwin_solver.effects.definition.effect import Scope

LEAST_SHARE = 0.1
"""Share of the diagnosed value, counted from the bound of its range, that a drawn one keeps."""

INTERVAL_DEVIATIONS = 3.29
"""Width of an interval of 90 % of a normal distribution, in standard deviations."""

OF_THE_RIG = (Scope.RIG, Scope.WELL, Scope.PLACE)
"""Scopes of effects that siblings can have."""

ASYMMETRY = 1.1
"""Ratio of the two sides of an interval above which it is that of a logarithm."""


class DiagnosedNumber(NamedTuple):
    """A parameter with doubt: its `mean` and standard `deviation`, in the unit of the effect.

    If it `is_log`, both belong to its logarithm.
    """

    name: str
    mean: float
    deviation: float
    is_log: bool = False

    @property
    def value(self) -> float:
        """The diagnosed value, in the unit of the effect."""
        return self.of(self.mean)

    def of(self, drawn: float) -> float:
        """Return the value for a `drawn` number or logarithm."""
        return math.exp(drawn) if self.is_log else drawn


@dataclass(frozen=True)
class DiagnosedEffect:
    """An effect with doubt about its parameters.

    `numbers` are the parameters with doubt, `fixed` those without: the name of a well, or a number
    without an interval.
    """

    name: str
    numbers: tuple[DiagnosedNumber, ...]
    fixed: tuple[tuple[str, str | float], ...] = ()

    def described(self, values: Iterator[float]) -> EffectDescription:
        """Return the effect with the next of `values` for its numbers, within their ranges."""
        known = effect(self.name).parameters
        drawn = {
            one.name: within(known[one.name], one.of(float(next(values))), one.value)
            for one in self.numbers
        }
        return EffectDescription(name=self.name, parameters={**dict(self.fixed), **drawn})


def within(parameter: Parameter, drawn: float, value: float) -> float:
    """Return `drawn` moved into the range of a parameter, all in its unit.

    Of a parameter that must be greater than a bound, a part of the way from the diagnosed `value`
    to the bound is the least.
    """
    least = parameter.low
    if parameter.above > -np.inf:
        least = max(least, parameter.above + LEAST_SHARE * (value - parameter.above))
    return float(np.clip(drawn, least, parameter.high))


def read_diagnosis(path: Path) -> tuple[DiagnosedEffect, ...]:
    """Return the effects of the rig that the `diagnosis.json` at `path` kept, if any.

    Effects of the camera and of the numerical scheme are none: they move no water or tracer.

    Raises:
        InputError: the file cannot be read, or lacks a key.
    """
    try:
        data = json.loads(read_regular(path))
        kept = [item for item in data['effects'] if item['name'] in data['combination']]
        return tuple(_diagnosed(item) for item in kept if effect(item['name']).scope in OF_THE_RIG)
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name a diagnosis.json') from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path}: no diagnosis.json ({error!r}); diagnose again') from None


def _diagnosed(item: dict[str, Any]) -> DiagnosedEffect:
    numbers: list[DiagnosedNumber] = []
    fixed: list[tuple[str, str | float]] = []
    for name, entry in item['parameters'].items():
        value = entry['value']
        if isinstance(value, str):
            fixed.append((name, value))
        elif entry['low'] == entry['high']:  # no interval: None, or no width
            fixed.append((name, float(value)))
        else:
            numbers.append(
                _with_doubt(name, *(float(entry[key]) for key in ('value', 'low', 'high')))
            )
    return DiagnosedEffect(str(item['name']), tuple(numbers), tuple(fixed))


def _with_doubt(name: str, value: float, low: float, high: float) -> DiagnosedNumber:
    """Return a number with its interval of 90 %, from `low` to `high`.

    The diagnosis fits the logarithm of a number known to a factor: its interval is wider
    above. As a plain number half of the siblings would have a hundred times as much.
    """
    if 0.0 < low < value and high - value > ASYMMETRY * (value - low):
        return DiagnosedNumber(
            name, math.log(value), math.log(high / low) / INTERVAL_DEVIATIONS, is_log=True
        )
    return DiagnosedNumber(name, value, (high - low) / INTERVAL_DEVIATIONS)
