"""The coarse grid for many long simulations: plans of rates, and the siblings."""

import math
from typing import TYPE_CHECKING

from porotwin_core.geometry.grid import Grid

if TYPE_CHECKING:  # the command line names the number of cells before it needs a rig
    from porotwin_core.rig import Rig

COARSE_CELLS = 2300
"""Cells of the grid: 15 mm on the small rig. Coarser cells blur the zone. Finer ones cost more and
leave kinks in the cost of a plan: with cells of 10 mm some searches end at 100 ml min, all of these
at 58 (docs/control.md)."""


def coarse_grid(rig: 'Rig', finest: Grid, cells: int = COARSE_CELLS) -> Grid:
    """Return a grid of about `cells` square cells over `rig`, at most as fine as `finest`."""
    wanted = rig.default_grid(math.sqrt(rig.width_m * rig.height_m / cells))
    return rig.grid(min(wanted.nx, finest.nx), min(wanted.nz, finest.nz))
