"""Plumes of an injection for several dispersivities, as a measure of photographs."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.effects.dispersion import EFFECT as DISPERSION
from porotwin_solver.effects.dispersion import TRANSVERSE_SHARE
from porotwin_solver.model.simulation import simulate

MOST_CELLS = 168_000
"""Most cells of the model: 5 mm on the large FluidFlower, a second for an injection."""


def plume_model(
    rig: Rig, schedule: Schedule, times: Sequence[float], cells: int = MOST_CELLS
) -> Callable[[float, float], list[FloatArray]]:
    """Return a function from a factor on all rates and a dispersivity to maps at `times` [s].

    The function returns one map (nz, nx) per time. The dispersivity [m] is that along the flow, in
    addition to the effects of the rig; 0 leaves these alone. The model has about `cells` cells, and
    at most `MOST_CELLS`.
    """
    size = math.sqrt(rig.width_m * rig.height_m / min(cells, MOST_CELLS))
    grid = rig.grid(round(rig.width_m / size), round(rig.height_m / size))

    def plumes(factor: float, dispersivity_m: float) -> list[FloatArray]:
        rows = tuple(
            replace(row, rate=replace(row.rate, rate=factor * row.rate.rate))
            for row in schedule.rows
        )
        scaled = replace(schedule, rows=rows)
        effects = [_dispersion(dispersivity_m)] if dispersivity_m > 0 else []
        maps = simulate(rig, scaled, np.array(times), grid=grid, preset='fast', effects=effects)
        return list(maps)

    return plumes


def _dispersion(dispersivity_m: float) -> EffectDescription:
    """Return the effect of dispersion in sand."""
    return DISPERSION.described(
        longitudinal_dispersivity=dispersivity_m,
        transverse_dispersivity=TRANSVERSE_SHARE * dispersivity_m,
    )
