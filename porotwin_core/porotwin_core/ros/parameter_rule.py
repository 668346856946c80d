"""The rule of one parameter of a node: default, meaning and allowed values."""

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from porotwin_core.basis.errors import InputError

TYPES = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'text'}
"""Types of parameters, in words."""


LARGEST_WHOLE = sys.maxsize
"""Largest whole number of a parameter: 64 bits with sign."""


@dataclass(frozen=True)
class ParameterRule:
    """The declaration of one parameter by its node.

    Attributes:
        name: name of the parameter, with its unit.
        default: value if none is given; its type is the type of the parameter.
        description: one line for people.
        at_least: smallest value of a number.
        at_most: largest value of a number.
        choices: the allowed texts; empty: any.
        changeable: whether it can change while the node runs.
    """

    name: str
    default: Any
    description: str
    at_least: float = -math.inf
    at_most: float = math.inf
    choices: tuple[str, ...] = ()
    changeable: bool = False

    @property
    def constraint(self) -> str:
        """The allowed values in words; empty if every value of the type is allowed."""
        if self.choices:
            return f'one of: {", ".join(self.choices)}'
        if self.at_least == -math.inf and self.at_most == math.inf:
            return ''
        if self.at_most == math.inf:
            return f'at least {self.at_least:g}'
        if self.at_least == -math.inf:
            return f'at most {self.at_most:g}'
        return f'from {self.at_least:g} to {self.at_most:g}'

    def check(self, value: Any, node: str) -> None:
        """Check that a value of the right type is in range, or one of the choices.

        Raises:
            InputError: one line with the parameter, the `node`, the value and what is allowed.
        """
        where = f"parameter '{self.name}' of {node} is"
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if number and not self.at_least <= value <= self.at_most:
            raise InputError(f'{where} {value:g}; it must be {self.constraint or "a number"}')
        if self.choices and value not in self.choices:
            raise InputError(f"{where} '{value}'; choose {self.constraint}")

    def taken(self, value: Any, node: str) -> Any:
        """Return `value` as the node will get it; whole numbers also count as numbers.

        Raises:
            InputError: the value is of another type, out of range or no choice.
        """
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            expected = TYPES.get(kind, f'a {kind.__name__}')
            raise InputError(f"parameter '{self.name}' of {node} is {value!r}; give {expected}")
        if kind is int and not -LARGEST_WHOLE <= value <= LARGEST_WHOLE:
            raise InputError(f"parameter '{self.name}' of {node} is {value}: too large for ROS 2")
        self.check(value, node)
        return value

    def as_json(self) -> dict[str, Any]:
        """Return the rule as an object for a JSON file, without limits that are infinite."""
        found: dict[str, Any] = {'default': self.default, 'description': self.description}
        if self.at_least != -math.inf:
            found['at_least'] = self.at_least
        if self.at_most != math.inf:
            found['at_most'] = self.at_most
        if self.choices:
            found['choices'] = list(self.choices)
        if self.changeable:
            found['changeable'] = True
        return found

    @classmethod
    def from_json(cls, name: str, data: Mapping[str, Any]) -> Self:
        """Return the rule of the parameter `name` from the object that `as_json` returned."""
        return cls(name, **{**data, 'choices': tuple(data.get('choices', ()))})
