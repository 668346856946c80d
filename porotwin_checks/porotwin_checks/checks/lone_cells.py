"""Does a single cell show a glare, a dead pixel, or a number for no value?"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from porotwin_checks.known import Known
from porotwin_checks.near_wells import cells_near
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import FloatArray

HOT_CELL, MOST_FALSE = 2.0, 0.01
"""Concentration [-] that no tracer has, and the largest share of a map that one kind of false
cells has."""

LONE_STEP, SPREADS = 0.3, 2.0
"""A cell stands alone if it differs from the median of its eight neighbours by more than this
concentration [-] and this multiple of their range. Noise and fronts have a range of their own."""


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


def _stand_alone(frame: FloatArray) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) unlike all neighbours. Cells of the rim have mirrored ones."""
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


def _find(known: Known) -> Iterator[Remark]:
    assert known.maps is not None
    grid, chosen = known.grid, known.looked_at
    wells = cells_near(known.rig.wells.values(), grid)
    found = np.concatenate([np.argwhere(false_cells(known.maps[one], wells)) for one in chosen])
    if len(found):
        row, column = found[0]
        yield Remark.of(
            'maps',
            '',
            '{count} cells in {maps} maps that were looked at are far above stock, or unlike all '
            'their neighbours, the first at x = {x_m:.3g} m, z = {z_m:.3g} m; look for a glare or '
            'a dead pixel. A diagnosis takes them as unseen',
            count=len(found),
            maps=len(chosen),
            x_m=grid.x[column],
            z_m=grid.z[row],
        )


CHECK = Check(needs=('maps',), find=_find, explained_by=('no_stock',))
