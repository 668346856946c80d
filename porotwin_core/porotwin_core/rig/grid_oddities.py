"""Finds grids that are too large to compute or too coarse for a rig."""

import itertools
import logging
import math
from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import Grid, conservative_resample
from porotwin_core.rig.control_zones import control_zones
from porotwin_core.rig.description import Rig

LOG = logging.getLogger('porotwin')
"""Receives a warning for every odd grid."""

MOST_CELLS = 1_000_000
"""Most cells of a grid: minutes for one prediction, gigabytes for the factorised flow."""

ODD_ASPECT = 3.0
"""Longer over shorter side of a cell above which a plume spreads unequally."""

MOST_ASPECT = 50.0
"""Longer over shorter side of a cell above which time steps and flow are hopeless."""

SMALLEST_CELL_M = 2e-4
"""Side of a cell below which sand is no continuum [m]: one grain of fine sand."""

LEAST_CELLS_BETWEEN = 3
"""Fewest cells between two wells, and across a zone, that resolve the plume there."""

SEALING = 0.01
"""Permeability over the median of the rig below which a sand is a barrier: clay or a seal."""

CLOSED = 0.99
"""Share of a cell that a barrier fills for water not to pass: the mean falls to a hundredth."""

LEAKY_SHARE = 0.1
"""Share of the area of barriers beside which no cell is closed, above which a grid is odd."""


def chosen_grid(text: str, rig: Rig, most_cells: int = MOST_CELLS) -> Grid:
    """Return the grid called `text`, such as 187x112, over `rig`.

    An odd grid is logged as a warning. `most_cells` bounds the grid; maps of photographs may have
    more cells than predictions.

    Raises:
        InputError: the text is no grid, or the grid cannot be computed.
    """
    grid = Grid.parse(text, rig.width_m, rig.height_m)
    for remark in remarks_about_grid(grid, rig, most_cells):
        if remark.refused:
            raise InputError(str(remark))
        LOG.warning('%s', remark)
    return grid


def remarks_about_grid(grid: Grid, rig: Rig, most_cells: int = MOST_CELLS) -> tuple[Remark, ...]:
    """Return the remarks about a grid over `rig`, impossible ones first."""
    found = [
        *_cells(grid, rig, most_cells),
        *_resolution(grid, rig),
        *remarks_about_barriers(grid, rig),
    ]
    return tuple(sorted(found, key=lambda remark: not remark.refused))


def remarks_about_barriers(grid: Grid, rig: Rig) -> Iterator[Remark]:
    """Yield a remark if water flows on `grid` through barriers of `rig` that are too thin for it.

    A cell holds the mean permeability of its sands, so that only a cell full of clay is closed.
    """
    permeability = rig.nominal_map('permeability_m2')
    if isinstance(permeability, float):
        return
    barrier = permeability < SEALING * np.median(permeability)
    if not barrier.any():
        return
    shares = conservative_resample(barrier.astype(float), grid.shape)
    from scipy import ndimage  # takes a third of the start of a node

    beside_closed = ndimage.binary_dilation(shares > CLOSED, structure=np.ones((3, 3)))
    rows, columns = (
        np.arange(count) * cells // count
        for count, cells in zip(barrier.shape, grid.shape, strict=True)
    )
    leaky = barrier & ~beside_closed[np.ix_(rows, columns)]
    if leaky.sum() > LEAKY_SHARE * barrier.sum():
        square = rig.width_m / barrier.shape[1]
        depth = ndimage.distance_transform_edt(np.pad(barrier, 1))[1:-1, 1:-1][leaky].max()
        width = (2.0 * depth - 1.0) * square
        why = (
            f'water flows through a barrier of {permeability[leaky].min():.2g} m2, which is '
            f'{1e3 * width:.2g} mm wide where cells measure {1e3 * max(grid.dx, grid.dz):.2g} mm'
        )
        yield Remark('grid', str(grid), why, f'take cells of at most {5e2 * width:.2g} mm')


def _usual_grid(rig: Rig) -> str:
    """Say which grid a rig has by default."""
    usual = rig.default_grid()
    return f'{usual} has square cells of {1e3 * usual.dx:.2g} mm'


def _cells(grid: Grid, rig: Rig, most_cells: int) -> Iterator[Remark]:
    better = _usual_grid(rig)
    count = grid.nx * grid.nz
    if count > most_cells:
        why = f'{count:,} cells are more than the {most_cells:,} that a computer can hold'
        yield Remark('grid', str(grid), why, better, refused=True)
    aspect = max(grid.dx / grid.dz, grid.dz / grid.dx)
    if aspect > ODD_ASPECT:
        why = f'its cells measure {1e3 * grid.dx:.3g} mm x {1e3 * grid.dz:.3g} mm'
        yield Remark('grid', str(grid), why, better, refused=aspect > MOST_ASPECT)
    if min(grid.dx, grid.dz) < SMALLEST_CELL_M:
        why = f'its cells are smaller than a grain: {1e3 * min(grid.dx, grid.dz):.2g} mm'
        yield Remark('grid', str(grid), why, better)


def _resolution(grid: Grid, rig: Rig) -> Iterator[Remark]:
    better = f'take more cells; {_usual_grid(rig)}'
    close = [
        (_cells_between(grid, first.x_m - second.x_m, first.z_m - second.z_m), one, other)
        for (one, first), (other, second) in itertools.combinations(rig.wells.items(), 2)
    ]
    cells, one, other = min(close, default=(math.inf, '', ''))
    if cells < LEAST_CELLS_BETWEEN:
        why = f"only {cells:.1f} cells lie between the wells '{one}' and '{other}'"
        yield Remark('grid', str(grid), why, better)
    for kind, zone in control_zones(rig):
        extent = np.ptp(np.vstack(zone.outlines), axis=0) / np.array([grid.dx, grid.dz])
        if extent.min() < LEAST_CELLS_BETWEEN:
            why = f'only {extent.min():.1f} cells lie across the zone to {kind}'
            yield Remark('grid', str(grid), why, better)


def _cells_between(grid: Grid, dx: float, dz: float) -> float:
    return math.hypot(dx / grid.dx, dz / grid.dz)
