"""The cost of a map, estimated before work begins, and the refusal of grids that cost too much.

A map needs memory for its samples (about one per decoded pixel) and for its cells. The
coefficients were measured on maps of 42,000 to 30 million cells from photographs of 36 megapixels.
"""

import os
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.geometry.sampling import choose_reduction, samples_across

FEWEST_PIXELS_PER_CELL = 0.7
"""Pixels of the file per cell in each direction below which cells show nothing new [px]."""
_MEMORY_SHARE = 0.6
"""Share of the memory of the computer that a map may take [-]; other nodes need the rest."""
_BYTES_AT_LEAST, _BYTES_PER_SAMPLE, _BYTES_PER_CELL = 280e6, 27.0, 102.0
"""Peak memory of a process that makes maps [bytes]; the first part belongs to its libraries."""


@dataclass(frozen=True)
class MapCost:
    """The cost of one map.

    Attributes:
        cells: cells of the map.
        memory_bytes: peak memory of the process [bytes].
        pixels_per_cell: pixels of the file per cell in each direction [px].
    """

    cells: int
    memory_bytes: float
    pixels_per_cell: float

    def __str__(self) -> str:
        """Return the cost in words."""
        return (
            f'{self.cells:,} cells and {self.memory_bytes / 1e9:.1f} GB of memory for a photograph'
        )


def map_cost(rig: Rig, grid: Grid, size: tuple[int, int]) -> MapCost:
    """Return the cost of maps on `grid` from photographs of `size` (columns, rows) [px].

    Raises:
        InputError: the rig has no camera, or an impossible one.
    """
    geometry = Geometry.of(rig)
    reduction = choose_reduction(geometry, grid, size[0])
    cells = grid.nx * grid.nz
    samples = cells * samples_across(geometry, grid, reduction) ** 2
    return MapCost(
        cells,
        _BYTES_AT_LEAST + samples * _BYTES_PER_SAMPLE + cells * _BYTES_PER_CELL,
        min(geometry.columns / grid.nx, geometry.rows / grid.nz),
    )


def refuse_costly(cost: MapCost, grid: Grid, memory_bytes: float | None = None) -> None:
    """Refuse maps that show nothing new, or that this computer cannot hold.

    `memory_bytes`: memory of the computer [bytes]; None: asked from the operating system.

    Raises:
        InputError: the grid costs too much; one line tells the cost and a grid that does not.
    """
    memory = physical_memory() if memory_bytes is None else memory_bytes
    if cost.pixels_per_cell < FEWEST_PIXELS_PER_CELL:
        most = cost.pixels_per_cell
        raise InputError(
            f'grid {grid}: {cost}, but a cell has only {most:.2g} pixels across; '
            f'{_coarser(grid, most)} shows all that is in the photograph'
        )
    if cost.memory_bytes > _MEMORY_SHARE * memory:
        share = _MEMORY_SHARE * memory / cost.memory_bytes
        raise InputError(
            f'grid {grid}: {cost}, too much for a computer with {memory / 1e9:.0f} GB; '
            f'take {_coarser(grid, 0.9 * float(np.sqrt(share)))}'
        )


def physical_memory() -> float:
    """Return the memory of this computer [bytes]."""
    return float(os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES'))


def _coarser(grid: Grid, factor: float) -> str:
    """Return the name of a grid with `factor` times the cells in each direction."""
    return f'{max(1, int(grid.nx * factor))}x{max(1, int(grid.nz * factor))}'
