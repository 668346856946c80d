"""Keep the tracer in a zone: tracer outside the zone, and near its edge, costs."""

from typing import Annotated

from pydantic import Field, FiniteFloat

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Polygon, Rig
from porotwin_hub.objectives.objective import (
    ObjectiveKind,
    ObjectiveParameters,
    WeightedTracer,
    pore_volume,
)
from porotwin_hub.objectives.zones import distance_to_outside, fuzzy_mask, zones_of


class KeepInParameters(ObjectiveParameters):
    """The zone, and the distance [m] over which the mask falls from 1 to 0 inside it."""

    zone_m: Polygon | None = None
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)]


def keep_in(rig: Rig, grid: Grid, parameters: KeepInParameters) -> WeightedTracer:
    """Return f(c) = integral of c varphi porosity depth dx [m^3].

    varphi is 1 outside the zone and falls to 0 at the distance `fuzziness_m` inside it.

    Raises:
        InputError: there is no zone, or it covers no cell of the rig.
    """
    (zone,) = zones_of(rig, (parameters.zone_m,), grid, 'zone_m')
    distance = distance_to_outside(zone, grid)
    pores = pore_volume(rig, grid)
    return WeightedTracer(
        goal='least tracer outside the zone',
        weights=fuzzy_mask(distance, parameters.fuzziness_m) * pores,
        disallowed=fuzzy_mask(distance, 0.0) * pores,
    )


OBJECTIVE = ObjectiveKind(
    name='keep_in',
    summary='least tracer outside a zone',
    parameters=KeepInParameters,
    make=keep_in,
)
