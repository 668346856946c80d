"""Parameters of effects: unit, range, default and neutral value, and how a report states them."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any, NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import did_you_mean
from porotwin_core.basis.plausibility import LENGTHS
from porotwin_core.basis.text_with_unit import plain_number
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S
from porotwin_core.rig import EffectDescription

Values = Mapping[str, Any]
"""Parameters of one effect by name: floats in the declared units, or the name of a well."""


class Reading(NamedTuple):
    """The unit of a parameter in reports: shown value = `factor` * value, in `unit`."""

    factor: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of an effect.

    Args:
        unit: the unit of its values; `-` without unit, `name` for the name of a well.
        above: values must be greater.
        low: least value.
        high: greatest value.
        default: value where none is given; None where one must be given.
        neutral: value that changes nothing; 1 for a factor.
        reading: unit in reports, if the usual unit for `unit` does not suit.
        is_name: the value is the name of a well.
        may_be_fixed: some candidates of a search fix the value instead of fitting it.
        is_logarithmic: errors of the value are errors of its logarithm.
        is_scored: the blind check compares the value with the truth. Places are scored by their
            distance instead.
        vector: components of one vector share this name; errors are relative to its length.
    """

    unit: str
    above: float = -math.inf
    low: float = -math.inf
    high: float = math.inf
    default: float | None = None
    neutral: float = 0.0
    reading: Reading | None = None
    is_name: bool = False
    may_be_fixed: bool = False
    is_logarithmic: bool = False
    is_scored: bool = True
    vector: str = ''

    @property
    def is_factor(self) -> bool:
        """Whether the value multiplies a nominal one, so that a report states per cent."""
        return self.unit == '-' and self.neutral == 1.0 and self.reading is None

    @property
    def of_changes(self) -> 'Parameter':
        """The parameter of a change on top of a value: one that is only added may be less, too."""
        if self.is_name or self.low != self.neutral:
            return self
        return replace(self, low=-self.high if self.neutral == 0.0 else 1.0 / self.high)

    def on_top(self, present: float, change: float) -> float:
        """Return the `present` value after a `change`: times a factor, plus another number."""
        return present + change if self.neutral == 0.0 else present * change

    def change(self, present: float, value: float) -> float:
        """Return the change that makes `value` of the `present` one; see `on_top`."""
        return value - present if self.neutral == 0.0 else value / present

    def checked(self, where: str, value: object) -> float | str:
        """Return `value` as a float, or as text where the parameter is a name.

        Raises:
            InputError: not a finite number, not a name, or out of range. The message starts with
                `where`.
        """
        if self.is_name:
            if not isinstance(value, str):
                raise InputError(f'{where} = {value}: give a name')
            return value
        try:
            number = plain_number(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f'{where} = {value!r}: give a number [{self.unit}]')
        if number <= self.above:
            raise InputError(f'{where} = {number:.6g}: must be greater than {self.above:g}')
        if not self.low <= number <= self.high:
            bound = f'at least {self.low:g}' if number < self.low else f'at most {self.high:g}'
            raise InputError(f'{where} = {number:.6g}: must be {bound}')
        return number


SINCE = 'since'
"""Name of the parameter of an effect with an onset: the time of a recording [s] at which it begins.
Without it the effect acts from the start."""

ONSET = Parameter(
    unit='s',
    low=0.0,
    high=LONGEST_EXPERIMENT_S,
    default=0.0,
    reading=Reading(1.0 / MINUTE_S, 'min'),
    may_be_fixed=True,
)
"""The parameter `SINCE`."""


def onset(effect: EffectDescription) -> float:
    """Return the time [s] from which on `effect` acts; 0 from the start."""
    return float(effect.parameters.get(SINCE, 0.0))


def lasting(effect: EffectDescription) -> EffectDescription:
    """Return `effect` as it is after its onset: a pump that has lost its rate does not get it back.

    A model of what follows the recording has this one.
    """
    kept = {name: value for name, value in effect.parameters.items() if name != SINCE}
    return EffectDescription(name=effect.name, parameters=kept)


HALF_INTERVAL = NormalDist().inv_cdf(0.95)
"""Half the width of a 90 % interval of a normal distribution, in standard deviations."""

FAR = 5.0
"""Place over size of the rig above which a place is probably in another unit."""

ALIKE = 0.7
"""Likeness of two effects from which one may be meant by the other: many end alike."""

HIGH = 1.0
"""Rise of a water level over height of the rig above which it is probably in another unit."""

LENGTHS_IN_THE_RIG = {
    **dict.fromkeys(('x', 'x_end'), ('wide', FAR)),
    **dict.fromkeys(('z', 'z_end'), ('high', FAR)),
    **dict.fromkeys(('top', 'bottom', 'left', 'right'), ('high', HIGH)),
}
"""The side of the rig that a parameter is compared with, and its greatest ratio."""


def check_places(effect: str, given: Mapping[str, object], width: float, height: float) -> None:
    """Check that places and water levels of an effect are in m.

    Args:
        effect: its name.
        given: its parameters.
        width: of the rig [m].
        height: of the rig [m].

    Raises:
        InputError: one is so large for the rig that it is in another unit.
    """
    for key, value in given.items():
        if key not in LENGTHS_IN_THE_RIG or not isinstance(value, int | float):
            continue
        side, most = LENGTHS_IN_THE_RIG[key]
        size = width if side == 'wide' else height
        if abs(value) > most * size:
            units = [name for name, factor in LENGTHS if abs(value) * factor <= size]
            asked = f'was this in {" or ".join(units)}? ' if units else ''
            raise InputError(
                f'effect {effect}: {key} = {value:g}: the rig is {size:g} m {side}; '
                f'{asked}write it in m'
            )


def written_effect(text: str) -> tuple[str, dict[str, str]]:
    """Return the name and the parameters of an effect as `text`, NAME:PARAM=VALUE,PARAM=VALUE.

    Raises:
        InputError: the text has another form, or gives a parameter twice.
    """
    name, _, rest = text.partition(':')
    given: dict[str, str] = {}
    for part in filter(None, (piece.strip() for piece in rest.split(','))):
        key, equals, value = part.partition('=')
        if not equals:
            raise InputError(f"effect '{text}': write NAME:PARAM=VALUE,PARAM=VALUE")
        if key.strip() in given:
            raise InputError(f"effect '{text}': gives '{key.strip()}' twice; keep one")
        given[key.strip()] = value.strip()
    return name.strip(), given


def known_effects(name: str, known: Iterable[str]) -> str:
    """Return the remedy for an effect `name` that is not among the `known` ones."""
    names = sorted(known)
    return did_you_mean(name, names, alike=ALIKE) or f'choose from {", ".join(names)}'


def checked_values(
    effect: str, parameters: Mapping[str, Parameter], given: Mapping[str, object]
) -> dict[str, float | str]:
    """Return the values of all `parameters` of the effect named `effect`, in range.

    Parameters that are not `given` take their default.

    Raises:
        InputError: an unknown, missing or impossible parameter, by name, value and remedy.
    """
    known = ', '.join(parameters)
    for name in given:
        if name not in parameters:
            raise InputError(f"effect {effect}: unknown parameter '{name}'; known: {known}")
    values: dict[str, float | str] = {}
    for name, parameter in parameters.items():
        value = given.get(name, parameter.default)
        if value is None:
            raise InputError(
                f"effect {effect}: parameter '{name}' [{parameter.unit}] is missing; "
                f'it needs {known}'
            )
        values[name] = parameter.checked(f'effect {effect}: {name}', value)
    return values


def changed_values(
    effect: str, parameters: Mapping[str, Parameter], given: Mapping[str, object]
) -> dict[str, float | str]:
    """Return `given` as `checked_values` does, where the values are changes of the `parameters`.

    Raises:
        InputError: as `checked_values`.
    """
    return checked_values(effect, {n: one.of_changes for n, one in parameters.items()}, given)
