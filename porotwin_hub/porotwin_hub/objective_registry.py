"""All objectives by name, and the objective that a rig description asks for."""

from typing import Any

import numpy as np
import pydantic

from porotwin_core.discovery import discovered
from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Control, Rig
from porotwin_core.rig.complaints import one_line
from porotwin_hub import objectives
from porotwin_hub.objective import Objective, ObjectiveKind, ObjectiveParameters

OBJECTIVES: dict[str, ObjectiveKind] = discovered(
    objectives.__name__, 'OBJECTIVE', ObjectiveKind, 'docs/extend/objective.md'
)
"""All objectives by name; every module in `porotwin_hub/objectives` defines one."""


def objective_kind(name: str) -> ObjectiveKind:
    """Return the objective called `name`.

    Raises:
        InputError: there is none; the message lists all names.
    """
    if name not in OBJECTIVES:
        raise InputError(f"objective '{name}': unknown; choose from {', '.join(OBJECTIVES)}")
    return OBJECTIVES[name]


def make_objective(rig: Rig, grid: Grid) -> Objective:
    """Return the objective of `rig` (`control.objective` of rig.yaml) for maps on `grid`.

    Raises:
        InputError: the rig has no control section, or its objective or a parameter is wrong.
    """
    if rig.control is None:
        raise InputError(f"rig '{rig.name}' has no control section; add one to rig.yaml")
    kind = objective_kind(rig.control.objective.name)
    objective = kind.make(rig, grid, _parameters(kind, rig.control))
    if objective(np.zeros(grid.shape)) == objective(np.ones(grid.shape)):
        raise InputError(
            f"objective '{kind.name}': an empty rig and a rig full of tracer cost the same; "
            f'does its zone [m] lie inside the rig of {rig.width_m} m x {rig.height_m} m?'
        )
    return objective


def _parameters(kind: ObjectiveKind, control: Control) -> ObjectiveParameters:
    twice = control.objective.parameters.keys() & {'disallowed_zone_m'}
    if twice and control.disallowed_zone_m:
        raise InputError(
            "control: 'disallowed_zone_m' stands in control and in its objective; keep one of them"
        )
    given: dict[str, Any] = _shared_parameters(kind, control) | control.objective.parameters
    section = f"objective '{kind.name}'"
    try:
        return kind.parameters.model_validate(given)
    except pydantic.ValidationError as error:
        raise InputError(one_line(section, error, section=section)) from None


def _shared_parameters(kind: ObjectiveKind, control: Control) -> dict[str, Any]:
    """Return the parameters that `control` itself holds, as far as the objective has them."""
    shared: dict[str, Any] = {'fuzziness_m': control.fuzziness_m}
    if control.disallowed_zone_m:
        shared['disallowed_zone_m'] = control.disallowed_zone_m
    return {name: value for name, value in shared.items() if name in kind.parameters.model_fields}
