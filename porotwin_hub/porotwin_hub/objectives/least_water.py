"""Use little water: the injection of the control wells costs. A part of a sum."""

from typing import Annotated

from pydantic import Field, FiniteFloat

from porotwin_core.basis.units import MINUTE_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_hub.objectives.objective import LeastWater, ObjectiveKind, ObjectiveParameters


class LeastWaterParameters(ObjectiveParameters):
    """The dose [ml min] that one ml of water is worth."""

    ml_min_per_ml: Annotated[FiniteFloat, Field(gt=0)] = 0.01


def least_water(_rig: Rig, _grid: Grid, parameters: LeastWaterParameters) -> LeastWater:
    """Return the cost of water alone; rig and grid do not matter."""
    return LeastWater(goal='little water', water_cost=MINUTE_S * parameters.ml_min_per_ml)


OBJECTIVE = ObjectiveKind(
    name='least_water',
    summary='little water, beside another objective',
    parameters=LeastWaterParameters,
    make=least_water,
)
