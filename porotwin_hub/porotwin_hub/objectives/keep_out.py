"""Keep the tracer out of a zone (paper, section 4): tracer in the zone and near it costs."""

from typing import Annotated

from pydantic import Field, FiniteFloat

from porotwin_core.grid import Grid
from porotwin_core.rig import Polygon, Rig
from porotwin_hub.objective import (
    ObjectiveKind,
    ObjectiveParameters,
    WeightedTracer,
    pore_volume,
)
from porotwin_hub.zones import cell_centres, checked_zone, distance_to_zone, fuzzy_mask


class KeepOutParameters(ObjectiveParameters):
    """The zone, and the distance [m] over which the mask falls from 1 to 0 outside it."""

    disallowed_zone_m: Polygon
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)] = 0.1


def keep_out(rig: Rig, grid: Grid, parameters: KeepOutParameters) -> WeightedTracer:
    """Return f(c) = integral of c varphi porosity depth dx [m^3].

    varphi is 1 in the zone and falls to 0 at the distance `fuzziness_m` outside it.

    Raises:
        InputError: the zone covers no cell of the rig.
    """
    polygon = checked_zone(parameters.disallowed_zone_m, grid, 'disallowed_zone_m')
    distance = distance_to_zone(cell_centres(grid), polygon).reshape(grid.shape)
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
