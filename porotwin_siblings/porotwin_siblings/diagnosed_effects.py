"""Effects that a diagnosis found, with the intervals of their parameters."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.effect_parameter import Parameter
from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_solver.effects import effect

LEAST_SHARE = 0.1
"""Share of the diagnosed value, counted from the bound of its range, that a drawn one keeps."""

INTERVAL_DEVIATIONS = 3.29
"""Width of an interval of 90 % of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class DiagnosedEffect:
    """An effect with doubt about its parameters.

    `numbers` are (name, value, standard deviation) in the units of the effect; `fixed` are the
    parameters without doubt: the name of a well, or a number without an interval.
    """

    name: str
    numbers: tuple[tuple[str, float, float], ...]
    fixed: tuple[tuple[str, str | float], ...] = ()

    def described(self, values: Iterator[float]) -> EffectDescription:
        """Return the effect with the next of `values` for its numbers, within their ranges."""
        known = effect(self.name).parameters
        drawn = {
            name: within(known[name], float(next(values)), value) for name, value, _ in self.numbers
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
    """Return the effects that the `diagnosis.json` at `path` kept; none without a verdict.

    Raises:
        InputError: the file cannot be read, or lacks a key.
    """
    try:
        data = json.loads(path.read_text(encoding='utf-8'))
        kept = [item for item in data['effects'] if item['name'] in data['combination']]
        return tuple(_diagnosed(item) for item in kept)
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name a diagnosis.json') from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path}: no diagnosis.json ({error!r}); diagnose again') from None


def _diagnosed(item: dict[str, Any]) -> DiagnosedEffect:
    numbers, fixed = [], []
    for name, entry in item['parameters'].items():
        value = entry['value']
        if isinstance(value, str):
            fixed.append((name, value))
        elif entry['low'] is None:  # the diagnosis did not fit it, or found no interval
            fixed.append((name, float(value)))
        else:
            deviation = (entry['high'] - entry['low']) / INTERVAL_DEVIATIONS
            numbers.append((name, float(value), float(deviation)))
    return DiagnosedEffect(str(item['name']), tuple(numbers), tuple(fixed))
