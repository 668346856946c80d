"""Reach a place at a time: the tracer shall be there then, neither earlier nor later matters."""

from typing import Annotated

from pydantic import Field, FiniteFloat

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Polygon, Rig
from porotwin_hub.objectives.objective import (
    ObjectiveKind,
    ObjectiveParameters,
    TargetTracer,
    pore_volume,
)
from porotwin_hub.objectives.zones import distance_to_zones, fuzzy_mask, zones_of


class ReachParameters(ObjectiveParameters):
    """The place, the time [min] after the start of the experiment, and the wanted concentration.

    `fuzziness_m` is the distance [m] over which the wish fades out beside the place.
    """

    zone_m: Polygon | None = None
    at_min: Annotated[FiniteFloat, Field(gt=0)]
    concentration: Annotated[FiniteFloat, Field(ge=0, le=1)] = 1.0
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)]


def reach(rig: Rig, grid: Grid, parameters: ReachParameters) -> TargetTracer:
    """Return f(c) = integral of (c - concentration)^2 varphi porosity depth dx [m^3], at one time.

    varphi is 1 at the place and falls to 0 at the distance `fuzziness_m` beside it.

    Raises:
        InputError: there is no place, or it covers no cell of the rig.
    """
    zones = zones_of(rig, (parameters.zone_m,), grid, 'zone_m')
    distance = distance_to_zones(zones, grid)
    weights = fuzzy_mask(distance, parameters.fuzziness_m) * pore_volume(rig, grid)
    return TargetTracer(
        goal=f'tracer at its place after {parameters.at_min:g} min',
        weights=weights,
        target=0.0 * weights + parameters.concentration,
        at=60.0 * parameters.at_min,
    )


OBJECTIVE = ObjectiveKind(
    name='reach',
    summary='tracer at a place at a time',
    parameters=ReachParameters,
    make=reach,
)
