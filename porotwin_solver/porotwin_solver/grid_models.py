"""The physics-based model on its own grid, and on one coarser grid for plans."""

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_solver.model import Model
from porotwin_solver.supervision import UNSUPERVISED, Supervision


class GridModels:
    """The model of a rig on the grid of the maps, and the latest one on another grid.

    A plan asks for dozens of long simulations, and a grid of half the columns and rows takes an
    eighth of the time. A coarser grid smears the plume more, so that it has a preset of its own.

    Attributes:
        own: the model on the grid of the maps.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        preset: str,
        coarse_preset: str,
        supervision: Supervision = UNSUPERVISED,
    ) -> None:
        """Prepare the model on `grid`.

        Raises:
            InputError: as `Model`.
        """
        self.own = Model(rig, grid, preset=preset, supervision=supervision)
        self.own.prepare()
        self._coarse_preset = coarse_preset
        self._other: Model | None = None

    def on(self, grid: Grid) -> Model:
        """Return the model on `grid`; a new one takes as long as a factorisation.

        Raises:
            InputError: the grid has more cells than that of the maps.
        """
        own = self.own
        if grid.shape == own.grid.shape:
            return own
        if grid.nx * grid.nz > own.grid.nx * own.grid.nz:
            raise InputError(
                f'grid {grid}: has more cells than the grid {own.grid} of the solver; '
                'send a coarser state'
            )
        if self._other is None or self._other.grid.shape != grid.shape:
            self._other = Model(
                own.rig,
                own.rig.grid(grid.nx, grid.nz),
                preset=self._coarse_preset,
                supervision=own.engine.supervision,
            )
            self._other.prepare()
        return self._other
