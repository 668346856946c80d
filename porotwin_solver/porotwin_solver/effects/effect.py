"""What an effect is: a name, parameters with units and ranges, and what it does to the model."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from porotwin_core.errors import InputError
from porotwin_solver.observation_operator import ObservationOperator
from porotwin_solver.physics import Physics

Values = Mapping[str, Any]
"""Parameters by name: floats in the units of the contract, and the name of a well as text."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: its unit, the open or closed range it must lie in, its default."""

    unit: str
    above: float = -math.inf
    low: float = -math.inf
    high: float = math.inf
    default: float | None = None
    is_name: bool = False

    def checked(self, where: str, value: object) -> float | str:
        """Return `value` as this parameter's type.

        Raises:
            InputError: not a number, not a name, or out of range; starts with `where`.
        """
        if self.is_name:
            if not isinstance(value, str):
                raise InputError(f'{where} = {value}: give a name')
            return value
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise InputError(f'{where} = {value!r}: give a number [{self.unit}]') from None
        if not math.isfinite(number):
            raise InputError(f'{where} = {number}: give a finite number [{self.unit}]')
        if number <= self.above:
            raise InputError(f'{where} = {number:.6g}: must be greater than {self.above:g}')
        if not self.low <= number <= self.high:
            bound = f'at least {self.low:g}' if number < self.low else f'at most {self.high:g}'
            raise InputError(f'{where} = {number:.6g}: must be {bound}')
        return number


@dataclass(frozen=True)
class Effect:
    """One effect of the diagnosis contract.

    `on_physics` returns changed physics, `on_observation` a changed observation operator; an effect
    has one of the two.
    """

    name: str
    parameters: Mapping[str, Parameter]
    on_physics: Callable[[Physics, Values], Physics] | None = None
    on_observation: Callable[[ObservationOperator, Values], ObservationOperator] | None = None

    def checked(self, given: Mapping[str, object]) -> dict[str, float | str]:
        """Return `given` complete and in range.

        Raises:
            InputError: an unknown, missing or impossible parameter, by name, value and remedy.
        """
        known = ', '.join(self.parameters)
        for name in given:
            if name not in self.parameters:
                raise InputError(f"effect {self.name}: unknown parameter '{name}'; known: {known}")
        values: dict[str, float | str] = {}
        for name, parameter in self.parameters.items():
            value = given.get(name, parameter.default)
            if value is None:
                raise InputError(
                    f"effect {self.name}: parameter '{name}' [{parameter.unit}] is missing; "
                    f'it needs {known}'
                )
            values[name] = parameter.checked(f'effect {self.name}: {name}', value)
        return values
