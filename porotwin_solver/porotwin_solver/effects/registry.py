"""Every effect by name, and how descriptions of effects change the model."""

import importlib
import pkgutil
from collections.abc import Iterable
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_solver.effects.effect import Effect
from porotwin_solver.observation_operator import ObservationOperator
from porotwin_solver.physics import Physics, check


def _found() -> dict[str, Effect]:
    effects = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        found = importlib.import_module(f'{__package__}.{module.name}').__dict__.get('EFFECT')
        if isinstance(found, Effect):
            effects[found.name] = found
    return effects


def effect(name: str) -> Effect:
    """Return the effect `name`.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    if name not in EFFECTS:
        raise InputError(f"effect '{name}': unknown; choose from {', '.join(sorted(EFFECTS))}")
    return EFFECTS[name]


def apply_effects(
    physics: Physics, operator: ObservationOperator, descriptions: Iterable[EffectDescription]
) -> tuple[Physics, ObservationOperator]:
    """Return `physics` and `operator` changed by every effect in turn.

    Raises:
        InputError: an unknown effect or parameter, a value out of range, an unknown well.
    """
    for description in descriptions:
        found = effect(description.name)
        values = found.checked(description.parameters)
        if found.on_physics is not None:
            physics = found.on_physics(physics, values)
            check(physics)
        if found.on_observation is not None:
            operator = found.on_observation(operator, values)
    return physics, operator


def parse_effect(text: str) -> EffectDescription:
    """Return the effect written as `NAME:PARAM=VALUE,PARAM=VALUE`, parameters checked.

    Raises:
        InputError: not of that form, or an unknown effect or parameter.
    """
    name, _, rest = text.partition(':')
    given: dict[str, object] = {}
    for part in filter(None, rest.split(',')):
        key, equals, value = part.partition('=')
        if not equals:
            raise InputError(f"effect '{text}': write NAME:PARAM=VALUE,PARAM=VALUE")
        given[key.strip()] = value.strip()
    found = effect(name.strip())
    return EffectDescription(name=found.name, parameters=found.checked(given))


EFFECTS: dict[str, Effect] = _found()
"""All effects of this package by name."""
