"""A check of finished maps: a well that injects tracer is full of it.

Tracer that a baseline shows already is not seen in later photographs. The plume then has a hole,
and the hole is at the well.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule

LEAST_AT_WELL = 0.5
"""Least concentration at a well relative to its injected one; below it the maps must be wrong [-].
Calibrated maps are right within a tenth there."""

_REACH = 2
"""Cells around the cell of a well that are looked at, to each side."""
_PERCENTILE = 90.0
"""Percentile of these cells that counts: a stream that leaves the well in a flow is narrow."""
_FILLINGS = 2.0
"""A well counts when it has injected this many times the pores of these cells [-]."""
_SAME = 0.02
"""Injected concentrations that differ by less are the same fluid [-]."""
_MOST_MAPS = 24
"""Maps that are looked at, evenly spread."""


class Maps(Protocol):
    """Maps (nz, nx) by their number, with NaN where nothing is known [-]."""

    def __getitem__(self, number: int, /) -> NDArray[Any]: ...


def pale_well_remark(maps: Maps, times: Sequence[float], rig: Rig, schedule: Schedule) -> str:
    """Return a remark if maps show little tracer at a well that injects it; '' if none does.

    Half of the maps of a well must show it: a clock or a tube may delay the first tracer.

    Args:
        maps: calibrated maps of concentration [-].
        times: their times [s], ascending.
        rig: the rig; its wells, depth and porosity.
        schedule: the injected rates.
    """
    shares: dict[str, list[float]] = {}
    numbers = np.linspace(0, len(times) - 1, min(len(times), _MOST_MAPS)).round().astype(int)
    for number in numbers:
        values = maps[int(number)]
        grid = rig.grid(*values.shape[::-1])
        for well in rig.wells:
            seen = _share_at(well, values, float(times[number]), rig, grid, schedule)
            if seen is not None:
                shares.setdefault(well, []).append(seen)
    for well, found in shares.items():
        share = float(np.median(found))
        if share < LEAST_AT_WELL:
            return (
                f'the maps show {100 * max(share, 0.0):.0f} % of the tracer at well {well} while '
                'it injects: the baseline shows tracer already, or the rates are wrong; take a '
                'baseline from before any tracer, and check the rates, the clock of the camera and '
                'camera.corners_px'
            )
    return ''


def _share_at(
    well: str, values: FloatArray, time: float, rig: Rig, grid: Grid, schedule: Schedule
) -> float | None:
    """Return the concentration at a well relative to the one it injects at `time` [s].

    None if the well injects no tracer, or too little yet, or if its cells are not known.
    """
    place = rig.wells[well]
    row, column = int(place.z_m / grid.dz), int(place.x_m / grid.dx)
    around = (
        slice(max(0, row - _REACH), row + _REACH + 1),
        slice(max(0, column - _REACH), column + _REACH + 1),
    )
    volume, injected = _same_fluid(schedule, well, time)
    near = values[around]
    if volume <= _FILLINGS * float(rig.cell_pore_volume(grid)[around].sum()):
        return None
    if injected <= 0 or not np.isfinite(near).any():
        return None
    return float(np.nanpercentile(near, _PERCENTILE)) / injected


def _same_fluid(schedule: Schedule, well: str, until: float) -> tuple[float, float]:
    """Return volume [m^3] and concentration [-] of the fluid that a well injects at `until` [s].

    Only fluid since the last pause or change of concentration counts.
    """
    rows = [row for row in schedule.rows if row.well == well and row.time < until]
    ends = [*(row.time for row in rows[1:]), until]
    volume = concentration = 0.0
    for row, end in zip(rows, ends, strict=False):  # without rows there is one end
        if row.rate.rate <= 0:
            volume = concentration = 0.0
            continue
        if abs(row.rate.concentration - concentration) > _SAME:
            volume, concentration = 0.0, row.rate.concentration
        volume += (end - row.time) * row.rate.rate
    return volume, concentration
