"""A check of finished maps: a well that injects tracer is full of it.

Tracer that a baseline shows already is not seen in later photographs. The plume then has a hole,
and the hole is at the well.
"""

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig, Well

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
_MOST_HIDDEN = 0.5
"""Share of the maps that may hide a well; more is told [-]."""
_MOST_MAPS = 24
"""Maps that are looked at, evenly spread."""


class Maps(Protocol):
    """Maps (nz, nx) by their number, with NaN where nothing is known [-]."""

    def __getitem__(self, number: int, /) -> NDArray[Any]: ...


def pale_well_remark(maps: Maps, times: Sequence[float], rig: Rig, schedule: Schedule) -> str:
    """Return a remark if maps show little or nothing at a well that injects tracer; '' else.

    Half of the maps of a well must show it: a clock or a tube may delay the first tracer. A well
    that no map shows is masked, and not judged.

    Args:
        maps: calibrated maps of concentration [-].
        times: their times [s], ascending.
        rig: the rig; its wells, depth and porosity.
        schedule: the injected rates.
    """
    shares: dict[str, list[float]] = {}
    uncovered: set[str] = set()
    numbers = np.linspace(0, len(times) - 1, min(len(times), _MOST_MAPS)).round().astype(int)
    for number in numbers:
        values = maps[int(number)]
        grid = rig.grid(*values.shape[::-1])
        pores = rig.cell_pore_volume(grid)
        for well, place in rig.wells.items():
            around = cells_around(place, grid, _REACH)
            if np.isfinite(values[around]).any():
                uncovered.add(well)
            seen = _share_at(
                values[around],
                float(pores[around].sum()),
                *_same_fluid(schedule, well, float(times[number])),
            )
            if seen is not None:
                shares.setdefault(well, []).append(seen)
    for well, found in shares.items():
        if well not in uncovered:
            continue
        if np.isnan(found).mean() > _MOST_HIDDEN:
            return (
                f'the maps hide well {well} while it injects tracer: it is covered, or the tracer '
                'has another colour than in the calibration; calibrate with this dye'
            )
        share = float(np.nanmedian(found))
        if share < LEAST_AT_WELL:
            return (
                f'the maps show {100 * max(share, 0.0):.0f} % of the tracer at well {well} while '
                'it injects: the baseline shows tracer already, or the rates are wrong; take a '
                'baseline from before any tracer, and check the rates, the clock of the camera and '
                'camera.corners_px'
            )
    return ''


def cells_around(well: Well, grid: Grid, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns of `grid` within `reach` cells of the cell of a well."""
    row, column = int(well.z_m / grid.dz), int(well.x_m / grid.dx)
    return (
        slice(max(0, row - reach), row + reach + 1),
        slice(max(0, column - reach), column + reach + 1),
    )


def _share_at(near: FloatArray, pores: float, volume: float, injected: float) -> float | None:
    """Return the concentration in the cells `near` a well relative to the one that it injects.

    None if the well injects no tracer, or too little yet; NaN if its cells are hidden.

    Args:
        near: concentration of these cells [-].
        pores: volume of their pores [m^3].
        volume: volume of the fluid that the well has injected [m^3].
        injected: its concentration [-].
    """
    if volume <= _FILLINGS * pores or injected <= 0:
        return None
    if not np.isfinite(near).any():
        return math.nan
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
