"""Hold a front: tracer on one side of a line, water on the other."""

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
from porotwin_hub.objectives.zones import distance_to_edge, fuzzy_mask, zones_of


class HoldFrontParameters(ObjectiveParameters):
    """The region of the tracer, and the width [m] of the band beside its edge that counts.

    Far from the edge tracer and water may be anywhere, so that a plume still has time to grow.
    """

    tracer_m: Polygon | None = None
    band_m: Annotated[FiniteFloat, Field(gt=0)] = 0.1


def hold_front(rig: Rig, grid: Grid, parameters: HoldFrontParameters) -> TargetTracer:
    """Return f(c) = integral of (c - c_wanted)^2 varphi porosity depth dx [m^3].

    c_wanted is 1 in the region of the tracer and 0 outside. varphi is 1 at its edge and falls to 0
    at the distance `band_m` on both sides. The sides of the rig are no edge.

    Raises:
        InputError: there is no region, or it covers no cell of the rig.
    """
    (zone,) = zones_of(rig, (parameters.tracer_m,), grid, 'tracer_m')
    distance, within = distance_to_edge(zone, grid)
    return TargetTracer(
        goal='front held',
        weights=fuzzy_mask(distance, parameters.band_m) * pore_volume(rig, grid),
        target=within,
    )


OBJECTIVE = ObjectiveKind(
    name='hold_front',
    summary='the front of the plume held at the edge of a region',
    parameters=HoldFrontParameters,
    make=hold_front,
)
