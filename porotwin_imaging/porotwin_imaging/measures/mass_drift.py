"""A check of finished maps in time: their tracer keeps to the injected tracer.

The excess of a map is its tracer less the tracer that was injected before it. A wrong size, a haze
over all photographs or a faint background keep it constant. Glass that fogs or gets dirty, light
that drifts, and tracer that fades make it grow or fall. So does a pump with a wrong rate.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from porotwin_core.basis.units import ML
from porotwin_core.checks.mass_check import LEAST_SHARE, stock_in_map
from porotwin_core.checks.well_check import Maps, cells_around
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig

_MOST_DRIFT = 0.12
"""Change of the excess over the injected tracer that is told [-]. In calibrated maps of a rig as
described it stays below 0.05."""
_LEAST_SEEN = 0.95
"""Share of the cells that a map must show: hidden tracer would count as lost [-]."""
_FEWEST_MAPS = 5
_AT_EXIT = 0.05
"""Concentration at a way out above which tracer may have left [-]."""
_EXIT_REACH = 3
"""Cells around a producing well, and beside an open side, that are looked at."""
_MORE = (
    'from {begin} to {end} s the maps gain {ml} ml of tracer more than the pumps injected: does '
    'dirt or light make the sand darker, or does a pump deliver more than rates.csv says?'
)
_LESS = (
    'from {begin} to {end} s the maps lose {ml} ml of the injected tracer, though none is near a '
    'way out: does the glass fog, does the tracer fade or leak, or does a pump deliver less than '
    'rates.csv says?'
)


def drift_remark(maps: Maps, times: Sequence[float], rig: Rig, schedule: Schedule) -> str:
    """Return how the tracer in the maps leaves the injected tracer; '' if it keeps to it.

    Less tracer is told only if none came near a producing well or an open side.

    Args:
        maps: calibrated maps of concentration [-].
        times: their times [s], ascending.
        rig: the rig; its depth, porosity and size give the pore volume.
        schedule: the injected rates.
    """
    if not schedule.rows or len(times) < _FEWEST_MAPS:
        return ''
    exits = _exits(rig, schedule, rig.grid(*maps[0].shape[::-1]))
    kept, excess, left = [], [], False
    for number, time in enumerate(times):
        values = maps[number]
        if np.isfinite(values).mean() < _LEAST_SEEN:
            continue
        kept.append(time)
        excess.append(stock_in_map(values, rig) - schedule.injected_stock(-np.inf, time))
        left = left or bool((values[exits] > _AT_EXIT).any())
    if len(kept) < _FEWEST_MAPS:
        return ''
    limit = max(
        _MOST_DRIFT * schedule.injected_stock(-np.inf, kept[-1]), LEAST_SHARE * rig.pore_volume
    )
    # medians of neighbours, so that one wrong photograph does not count
    smooth = median_filter(np.array(excess), 3, mode='nearest')
    for sign, words in ((1.0, _MORE), (-1.0, _LESS)):
        first, last = _largest_rise(sign * smooth)
        change = sign * (smooth[last] - smooth[first])
        if change > limit and not (sign < 0.0 and left):
            return words.format(
                begin=f'{kept[first]:.0f}', end=f'{kept[last]:.0f}', ml=f'{change * ML:.3g}'
            )
    return ''


def _largest_rise(values: FloatArray) -> tuple[int, int]:
    """Return the numbers of the two values, in their order, between which the rise is largest."""
    rise = values - np.minimum.accumulate(values)
    last = int(np.argmax(rise))
    return int(np.argmin(values[: last + 1])), last


def _exits(rig: Rig, schedule: Schedule, grid: Grid) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) at wells that produce, at sides with water, and in canals."""
    exits: NDArray[np.bool_] = np.zeros(grid.shape, dtype=bool)
    for name in {row.well for row in schedule.rows if row.rate.rate < 0.0}:
        exits[cells_around(rig.wells[name], grid, _EXIT_REACH)] = True
    edges = {
        'bottom': exits[:_EXIT_REACH],
        'top': exits[-_EXIT_REACH:],
        'left': exits[:, :_EXIT_REACH],
        'right': exits[:, -_EXIT_REACH:],
    }
    for body in rig.water_bodies.values():
        if body.side is not None:
            edges[body.side][:] = True
        else:
            x, z = np.meshgrid(grid.x, grid.z)
            places, corners = np.column_stack([x.ravel(), z.ravel()]), np.array(body.corners_m)
            exits |= inside(places, corners).reshape(grid.shape)
    return exits
