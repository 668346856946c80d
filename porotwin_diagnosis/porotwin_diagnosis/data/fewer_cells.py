"""Maps of very many cells, averaged over larger ones: a search simulates on cells half and a third
as large as those of the maps, again and again."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from porotwin_core.geometry.grid import Grid, conservative_resample
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import Maps, MapSeries

Series = TypeVar('Series', bound=MapSeries)

MOST_CELLS = 60_000
"""Cells of a map that a search keeps. The large rig has 42 000 on cells of 1 cm. On cells of 5 mm
it has 168 000, and a single simulation of the finest level would have 1.5 million."""


def with_fewer_cells(
    recording: Recording,
    tell: Callable[[str], None] = lambda _line: None,
    most_cells: int = MOST_CELLS,
) -> Recording:
    """Return `recording` with at most `most_cells` cells per map, and tell it.

    The files of the recording stay as they are.

    Whole numbers of cells are averaged each way. A cell is NaN if a part of it is. The standard
    deviations are averaged too: errors of neighbouring cells of a photograph are alike, so that a
    mean errs about as much as they do.

    Raises:
        InputError: the recording holds no maps.
    """
    maps = recording.present_maps
    factor = math.ceil(math.sqrt(maps.grid.nx * maps.grid.nz / most_cells))
    if factor == 1:
        return recording
    rows, columns = (max(1, round(count / factor)) for count in maps.grid.shape)
    grid = recording.rig.grid(columns, rows)
    tell(f'{recording.source}: the maps of {maps.grid} cells are averaged over {grid} cells')
    deviation, systematic = (
        series and _averaged(series, grid) for series in (maps.deviation, maps.systematic)
    )
    averaged = replace(_averaged(maps, grid), deviation=deviation, systematic=systematic)
    return replace(recording, maps=averaged)


def _averaged(series: Series, grid: Grid) -> Series:
    """Return `series` averaged over the cells of `grid`."""

    def read(start: int, stop: int) -> Maps:
        shown = series.read(start, stop)
        averaged = [conservative_resample(frame, grid.shape) for frame in shown]
        return np.array(averaged, np.float32).reshape(-1, *grid.shape)

    return replace(series, grid=grid, read=read)
