"""Every effect by name, and how descriptions of effects change the model."""

import math
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace

from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.effect_parameter import (
    SINCE,
    check_places,
    known_effects,
    onset,
    written_effect,
)
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.coefficients.physics import Physics, check, nominal_physics
from porotwin_solver.effects.definition.effect import GUIDE, Effect, Scope

PACKAGE = __package__.removesuffix('.definition')
"""The package whose modules are effects."""


def _found() -> dict[str, Effect]:
    """Return the effects of the package in their order.

    Raises:
        InputError: a module is no complete effect.
    """
    effects = discovered(PACKAGE, 'EFFECT', Effect, GUIDE)
    return dict(sorted(effects.items(), key=lambda item: (item[1].order, item[0])))


def effect(name: str) -> Effect:
    """Return the effect `name`.

    Raises:
        InputError: there is none; the message lists all effects, or a similar one.
    """
    if name not in EFFECTS:
        raise InputError(f"effect '{name}': unknown; {known_effects(name, EFFECTS)}")
    return EFFECTS[name]


def effects_of(*scopes: Scope) -> list[Effect]:
    """Return the effects that belong to one of `scopes`, in their order."""
    return [found for found in EFFECTS.values() if found.scope in scopes]


def summary(found: Effect) -> str:
    """Return the first line of the docstring of the effect's module."""
    return (sys.modules[f'{PACKAGE}.{found.name}'].__doc__ or '').strip().splitlines()[0]


def described_physics(rig: Rig, grid: Grid, effects: Iterable[EffectDescription] = ()) -> Physics:
    """Return the coefficients of `rig` on `grid` with its own effects and then the given ones.

    Raises:
        InputError: as `nominal_physics` or `changed_physics`.
    """
    physics = replace(nominal_physics(rig, grid), levels=frozenset(rig.levels))
    return changed_physics(physics, (*rig.effects, *effects))


def tracer_storage(rig: Rig, grid: Grid) -> FloatArray:
    """Return the stock of each cell per unit of concentration [m^3], (nz, nx): `Physics.storage`.

    All who ask how much tracer a map holds weight its cells with it.

    Raises:
        InputError: as `described_physics`.
    """
    return described_physics(rig, grid).storage if rig.effects else rig.cell_pore_volume(grid)


def changed_physics(physics: Physics, descriptions: Iterable[EffectDescription]) -> Physics:
    """Return `physics` changed by every described effect in turn; the camera's change nothing.

    Raises:
        InputError: an unknown effect or parameter, a value out of range, an unknown well, a change
            that no rig can have.
    """
    for found, values in _members(descriptions):
        check_places(found.name, values, physics.grid.width, physics.grid.height)
        if found.on_physics is not None:
            physics = found.on_physics(physics, values)
            check(physics)
    return physics


def physics_on_top(physics: Physics, changes: Iterable[EffectDescription]) -> Physics:
    """Return `physics` with every change in turn on top of what it has; see `Effect.on_top`.

    Raises:
        InputError: as `changed_physics`.
    """
    for change in changes:
        check_places(change.name, change.parameters, physics.grid.width, physics.grid.height)
        physics = effect(change.name).on_top(physics, change.parameters)
    check(physics)
    return physics


def described_changes(
    rig: Rig, grid: Grid, descriptions: Iterable[EffectDescription]
) -> tuple[EffectDescription, ...]:
    """Return described effects of `rig` as changes, with which `physics_on_top` does the same.

    Raises:
        InputError: as `described_physics`.
    """
    physics, changes = described_physics(rig, grid), []
    for described in descriptions:
        changes.append(effect(described.name).change(physics, described.parameters))
        physics = changed_physics(physics, [described])
    return tuple(changes)


def observation_operator(
    descriptions: Iterable[EffectDescription], time: float = math.inf
) -> ObservationOperator:
    """Return how a camera sees a map at `time` [s], with every described effect of it in turn.

    Raises:
        InputError: an unknown effect or parameter, or a value out of range.
    """
    operator = ObservationOperator()
    for found, values in _members(descriptions):
        begins = float(values.get(SINCE, 0.0))
        if found.on_observation is not None and begins <= max(time, 0.0):
            operator = found.on_observation(operator, values)
    return operator


def acting(descriptions: Iterable[EffectDescription], time: float) -> tuple[EffectDescription, ...]:
    """Return the checked effects that act at `time` [s]; those with a later onset do not."""
    return tuple(one for one in descriptions if onset(one) <= max(time, 0.0))


def rig_at(rig: Rig, time: float) -> Rig:
    """Return `rig` with those of its effects that act at `time` [s]."""
    return rig.model_copy(update={'effects': acting(rig.effects, time)})


def _members(
    descriptions: Iterable[EffectDescription],
) -> Iterator[tuple[Effect, dict[str, float | str]]]:
    """Yield every described effect with all its parameters, checked."""
    for description in descriptions:
        found = effect(description.name)
        yield found, found.checked(description.parameters)


def parse_effect(text: str) -> EffectDescription:
    """Return the effect written as `NAME:PARAM=VALUE,PARAM=VALUE`, parameters checked.

    Raises:
        InputError: not of that form, an unknown effect or parameter, or no parameter.
    """
    name, given = written_effect(text)
    found = effect(name)
    values = found.checked(given)
    if not given:
        raise InputError(
            f"effect '{text}': changes nothing; give some of {', '.join(found.parameters)}"
        )
    return EffectDescription(name=found.name, parameters=values)


def parse_effects(texts: Iterable[str]) -> list[EffectDescription]:
    """Return the effects written as in `parse_effect`; only effects at a place may come twice.

    Raises:
        InputError: as there, or an effect of the rig, camera or one well is given twice.
    """
    found: dict[tuple[object, ...], EffectDescription] = {}
    for number, text in enumerate(texts):
        new = parse_effect(text)
        several = effect(new.name).scope is Scope.PLACE
        key = (new.name, number if several else new.parameters.get('well'))
        if key in found:
            raise InputError(
                f"effect '{text}': {new.name} is given twice, and both would act; keep one"
            )
        found[key] = new
    return list(found.values())


EFFECTS: dict[str, Effect] = _found()
"""All effects by name, in their order."""
