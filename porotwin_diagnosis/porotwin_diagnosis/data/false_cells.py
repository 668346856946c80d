"""Single cells of a map that no tracer explains: a glare, a dead pixel, a number for "no value"."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Well
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import Maps

HOT_CELL, MOST_FALSE = 2.0, 0.01
"""Concentration [-] that no tracer has, and the largest share of a map that one kind of false
cells has."""

LONE_STEP, SPREADS = 0.3, 2.0
"""A cell stands alone if it differs from the median of its eight neighbours by more than this
concentration [-] and this multiple of their range. Noise and fronts have a range of their own."""

WELL_CELLS = 2.5
"""A single cell may hold tracer up to this distance from a well [cells]."""


def without_false_cells(recording: Recording) -> Recording:
    """Return `recording` with NaN in the false cells of its maps; its files stay as they are.

    Raises:
        InputError: the recording holds no maps.
    """
    maps = recording.present_maps
    wells = cells_near(recording.rig.wells.values(), maps.grid)

    def read(start: int, stop: int) -> Maps:
        shown = np.array(maps.read(start, stop))
        for frame in shown:
            frame[false_cells(frame, wells)] = np.nan
        return shown

    return replace(recording, maps=replace(maps, read=read))


def false_cells(frame: FloatArray, wells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of `frame` [-] that are far above stock, or stand alone.

    More than a few of one kind have another cause, such as another scale or much noise: then none
    is false. Cells near `wells` (nz, nx) may stand alone.
    """
    hot = frame > HOT_CELL
    if hot.mean() > MOST_FALSE:
        return np.zeros_like(hot)
    lone = _stand_alone(np.where(hot, np.nan, frame)) & ~wells
    return hot | lone if lone.mean() <= MOST_FALSE else hot


def cells_near(wells: Iterable[Well], grid: Grid) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of `grid` that lie near one of `wells`."""
    near = np.zeros(grid.shape, dtype=bool)
    for well in wells:
        away = np.hypot(grid.x[None, :] - well.x_m, grid.z[:, None] - well.z_m)
        near |= away < well.radius_m + WELL_CELLS * max(grid.dx, grid.dz)
    return near


def _stand_alone(frame: FloatArray) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) that no neighbour is like; those of the rim have neighbours."""
    rim = np.pad(frame, 1, mode='reflect' if min(frame.shape) > 1 else 'edge')
    rows, columns = frame.shape
    around = np.stack(
        [
            rim[down : down + rows, right : right + columns]
            for down in range(3)
            for right in range(3)
            if (down, right) != (1, 1)
        ]
    )
    # NaN beside a cell makes its range NaN, and the comparison false: it is not judged
    spread = around.max(axis=0) - around.min(axis=0)
    return np.abs(frame - np.median(around, axis=0)) > LONE_STEP + SPREADS * spread
