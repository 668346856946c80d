"""All objectives by name, and the objective that a rig description asks for."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import numpy as np
import pydantic
from pydantic import Field, FiniteFloat

from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Control, Rig
from porotwin_core.rig.complaints import one_line
from porotwin_core.rig.control_zones import control_zones
from porotwin_hub.objectives.objective import (
    Objective,
    ObjectiveKind,
    ObjectiveParameters,
    WeightedSum,
)

P = TypeVar('P', bound=ObjectiveParameters)

OBJECTIVES: dict[str, ObjectiveKind] = discovered(
    __package__,
    'OBJECTIVE',
    ObjectiveKind,
    'docs/extend/objective.md',
    helpers=('objective', 'objective_registry', 'zones'),
)
"""All objectives by name; every module in `porotwin_hub/objectives` defines one."""

SUM = 'sum'
"""The name of several objectives at once: {name: sum, parts: [{name:, weight:, ...}, ...]}."""


class Part(ObjectiveParameters):
    """One objective of a sum: its name, its weight [-], and its own parameters."""

    model_config = pydantic.ConfigDict(extra='allow', frozen=True)

    name: str
    weight: Annotated[FiniteFloat, Field(gt=0)] = 1.0


class SumParameters(ObjectiveParameters):
    """The parts of a sum, at least one."""

    parts: Annotated[tuple[Part, ...], Field(min_length=1)]


def objective_kind(name: str) -> ObjectiveKind:
    """Return the objective called `name`.

    Raises:
        InputError: there is none; the message lists all names.
    """
    if name == SUM:
        raise InputError("objective 'sum': stands inside a sum; write all parts side by side")
    if name not in OBJECTIVES:
        known = ', '.join([*OBJECTIVES, SUM])
        raise InputError(f"objective '{name}': unknown; choose from {known}")
    return OBJECTIVES[name]


def make_objective(rig: Rig, grid: Grid) -> Objective:
    """Return the objective of `rig` (`control.objective` of rig.yaml) for maps on `grid`.

    Raises:
        InputError: the rig has no control section, or its objective or a parameter is wrong.
    """
    if rig.control is None:
        raise InputError(f"rig '{rig.name}' has no control section; add one to rig.yaml")
    wanted = rig.control.objective
    if rig.zone is not None and all(one.zone is not rig.zone for one in control_zones(rig)):
        raise InputError(
            f"control.zone: objective '{wanted.name}' takes no zone, or has corners of its own; "
            'keep one of them'
        )
    if wanted.name != SUM:
        return _made(rig, grid, rig.control, wanted.name, wanted.parameters)
    sum_ = _checked(SumParameters, wanted.parameters, SUM)
    made = WeightedSum(
        tuple(
            (part.weight, _made(rig, grid, rig.control, part.name, part.model_extra or {}))
            for part in sum_.parts
        )
    )
    if not any(_minds_tracer(part, grid) for _, part in made.parts):
        names = ', '.join(part.name for part in sum_.parts)
        raise InputError(
            f"objective 'sum': parts = {names}: tracer costs nothing, so that no well would ever "
            'pump; add a part such as keep_out'
        )
    return made


def _made(
    rig: Rig, grid: Grid, control: Control, name: str, parameters: Mapping[str, Any]
) -> Objective:
    kind = objective_kind(name)
    twice = parameters.keys() & {'disallowed_zone_m'}
    if twice and control.disallowed_zone_m:
        raise InputError(
            "control: 'disallowed_zone_m' stands in control and in its objective; keep one of them"
        )
    given = _shared_parameters(kind, control) | dict(parameters)
    checked = _checked(kind.parameters, given, name)
    moment = getattr(checked, 'at_min', 0.0)
    if control.end_min is not None and moment > control.end_min:
        raise InputError(
            f"objective '{name}': at_min = {moment:g} lies after control.end_min = "
            f'{control.end_min:g}, the end of the experiment; correct one of them'
        )
    try:
        objective = kind.make(rig, grid, checked)
    except InputError as error:
        raise InputError(f"objective '{name}': {error}") from None
    if not _minds_tracer(objective, grid) and not objective.water_cost:
        raise InputError(
            f"objective '{kind.name}': an empty rig and a rig full of tracer cost the same; "
            f'does its zone [m] lie inside the rig of {rig.width_m} m x {rig.height_m} m?'
        )
    return objective


def _minds_tracer(objective: Objective, grid: Grid) -> bool:
    """Return whether an empty rig, a full one and one filled upward cost differently."""
    half = 0.0 * grid.x + np.linspace(0.0, 1.0, grid.nz)[:, None]
    return len({objective(values) for values in (0.0 * half, 0.0 * half + 1.0, half)}) > 1


def _checked(model: type[P], given: Mapping[str, Any], name: str) -> P:
    section = f"objective '{name}'"
    try:
        return model.model_validate(given)
    except pydantic.ValidationError as error:
        raise InputError(one_line(section, error, section=section)) from None


def _shared_parameters(kind: ObjectiveKind, control: Control) -> dict[str, Any]:
    """Return the parameters that `control` itself holds, as far as the objective has them."""
    shared: dict[str, Any] = {'fuzziness_m': control.fuzziness_m}
    if control.disallowed_zone_m:
        shared['disallowed_zone_m'] = control.disallowed_zone_m
    return {name: value for name, value in shared.items() if name in kind.parameters.model_fields}
