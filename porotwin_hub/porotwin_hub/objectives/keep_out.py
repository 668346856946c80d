"""Keep the tracer out of zones (paper, section 4): tracer in a zone and near it costs."""

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
from porotwin_hub.objectives.zones import distance_to_zones, fuzzy_mask, zones_of


class KeepOutParameters(ObjectiveParameters):
    """One zone or several, and the distance [m] over which the mask falls from 1 to 0 outside."""

    disallowed_zone_m: Polygon | None = None
    zones_m: tuple[Polygon, ...] = ()
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)]


def keep_out(rig: Rig, grid: Grid, parameters: KeepOutParameters) -> WeightedTracer:
    """Return f(c) = integral of c varphi porosity depth dx [m^3].

    varphi is 1 in the zones and falls to 0 at the distance `fuzziness_m` outside them.

    Raises:
        InputError: there is no zone, or one covers no cell of the rig.
    """
    given = (parameters.disallowed_zone_m, *parameters.zones_m)
    key = 'zones_m' if parameters.zones_m else 'disallowed_zone_m'
    distance = distance_to_zones(zones_of(rig, given, grid, key), grid)
    pores = pore_volume(rig, grid)
    return WeightedTracer(
        goal='least tracer in the disallowed zone',
        weights=fuzzy_mask(distance, parameters.fuzziness_m) * pores,
        disallowed=fuzzy_mask(distance, 0.0) * pores,
    )


OBJECTIVE = ObjectiveKind(
    name='keep_out',
    summary='least tracer in a zone',
    parameters=KeepOutParameters,
    make=keep_out,
)
