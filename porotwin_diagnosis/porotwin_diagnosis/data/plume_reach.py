"""Places of the first map that the stock of no well can have reached."""

import numpy as np
from numpy.typing import NDArray

from porotwin_core.rates.wells import Schedule
from porotwin_diagnosis.data.observed_maps import VISIBLE_TRACER
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.coefficients.discs import radial_front

REACH = 2.5
"""Reach of a plume over the radius of a disc of its volume [-]."""


def tracer_beyond_reach(recording: Recording, rates: Schedule, until: float) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of the first map with tracer that no well can have brought there.

    The stock that a well injects until the time `until` [s] fills a disc around it
    (`radial_front`). Flow stretches the disc, so that `REACH` of its radius counts.
    """
    maps, rig = recording.present_maps, recording.rig
    grid = maps.grid
    thickness = float(rig.cell_pore_volume(grid).mean()) / grid.cell_area
    x, z = np.meshgrid(grid.x, grid.z)
    far: NDArray[np.bool_] = np.nan_to_num(maps[0]) > VISIBLE_TRACER
    for name in rates.wells:
        alone = Schedule(tuple(row for row in rates.rows if row.well == name))
        radius = radial_front(alone.injected_stock(-np.inf, until), thickness=thickness)
        well = rig.wells[name]
        far &= np.hypot(x - well.x_m, z - well.z_m) > REACH * radius
    return far
