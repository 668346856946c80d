"""Sweep a region: fill it with tracer, or wash the tracer out of it."""

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


class SweepParameters(ObjectiveParameters):
    """The regions, and the concentration that they shall have: 1 stock, 0 water.

    `fuzziness_m` is the distance [m] over which the wish fades out beside a region. It draws the
    plume towards a region that it does not touch yet.
    """

    zones_m: tuple[Polygon, ...] = ()
    concentration: Annotated[FiniteFloat, Field(ge=0, le=1)] = 1.0
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)]


def sweep(rig: Rig, grid: Grid, parameters: SweepParameters) -> TargetTracer:
    """Return f(c) = integral of (c - concentration)^2 varphi porosity depth dx [m^3].

    varphi is 1 in the regions and falls to 0 at the distance `fuzziness_m` outside them.

    Raises:
        InputError: there is no region, or one covers no cell of the rig.
    """
    zones = zones_of(rig, parameters.zones_m, grid, 'zones_m')
    distance = distance_to_zones(zones, grid)
    weights = fuzzy_mask(distance, parameters.fuzziness_m) * pore_volume(rig, grid)
    return TargetTracer(
        goal='region swept', weights=weights, target=0.0 * weights + parameters.concentration
    )


OBJECTIVE = ObjectiveKind(
    name='sweep',
    summary='a region filled with tracer, or washed free of it',
    parameters=SweepParameters,
    make=sweep,
)
