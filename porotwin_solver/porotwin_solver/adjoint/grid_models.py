"""The physics-based model on its own grid, and on one coarser grid for plans."""

import math
from collections.abc import Sequence
from functools import partial

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.schedule_cost import schedule_cost
from porotwin_solver.effects import physics_on_top
from porotwin_solver.model.implicit_model import ImplicitModel
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import IMPLICIT
from porotwin_solver.model.supervision import UNSUPERVISED, Supervision


def refuse_another_size(grid: Grid, own: Grid, kind: str) -> None:
    """Return if `grid`, of a message of this `kind`, covers the rig as the `own` grid does.

    Raises:
        InputError: its width or height is another one.
    """
    if not grid.covers_the_same(own):
        raise InputError(
            f'{kind} of {grid.width:g} m x {grid.height:g} m: the rig of the solver is '
            f'{own.width:g} m x {own.height:g} m; give both the same rig.yaml'
        )


class GridModels:
    """The model of a rig on the grid of the maps, and the latest one for plans.

    A plan asks for dozens of long simulations, and a grid of half the columns and rows takes an
    eighth of the time. A coarser grid smears the plume more, so that it has a preset of its own.

    Attributes:
        own: the model on the grid of the maps.
        effects: those that act beyond the description of the rig.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        preset: str,
        coarse_preset: str,
        effects: Sequence[EffectDescription] = (),
        supervision: Supervision = UNSUPERVISED,
    ) -> None:
        """Prepare the model on `grid`, with `effects` beyond those of `rig`.

        Raises:
            InputError: as `Model`.
        """
        self.effects = tuple(effects)
        kind = ImplicitModel if preset == IMPLICIT else Model
        self.own: Model = kind(rig, grid, preset=preset, effects=effects, supervision=supervision)
        self.own.prepare()
        self._coarse_preset = coarse_preset
        self._other: Model | None = None
        self._learnt = NO_LEARNT_PHYSICS

    def with_effects(self, effects: Sequence[EffectDescription]) -> 'GridModels':
        """Return the same models with other `effects` than the rig has.

        Raises:
            InputError: as `Model`.
        """
        own = self.own
        return GridModels(
            own.rig,
            own.grid,
            preset=own.preset,
            coarse_preset=self._coarse_preset,
            effects=effects,
            supervision=own.engine.supervision,
        )

    def on(self, grid: Grid, learnt: LearntPhysics = NO_LEARNT_PHYSICS) -> Model:
        """Return the model on `grid` with the `learnt` physics of the data-driven model.

        A new one takes as long as a factorisation.

        Raises:
            InputError: the grid has more cells than that of the maps, or another width or height;
                or the model cannot have the learnt physics.
        """
        own = self.own
        refuse_another_size(grid, own.grid, 'state')
        is_own = grid.shape == own.grid.shape
        if is_own and learnt == NO_LEARNT_PHYSICS:
            return own
        if grid.nx * grid.nz > own.grid.nx * own.grid.nz:
            raise InputError(
                f'grid {grid}: has more cells than the grid {own.grid} of the solver; '
                'send a coarser state'
            )
        known = self._other
        if known is None or known.grid.shape != grid.shape or self._learnt != learnt:
            known = Model(
                own.rig,
                own.rig.grid(grid.nx, grid.nz),
                preset=own.preset if is_own else self._coarse_preset,
                effects=self.effects,
                adapt=partial(physics_on_top, changes=learnt.effects),
                supervision=own.engine.supervision,
            )
            known.prepare()
            self._other, self._learnt = known, learnt
        return known

    def plan_cost(
        self,
        initial: FloatArray,
        plan: Sequence[RateStep],
        *,
        horizon: float,
        terms: Sequence[CostTerm],
        with_gradient: bool,
        learnt: LearntPhysics = NO_LEARNT_PHYSICS,
        patience: float = math.inf,
    ) -> tuple[float, FloatArray | None]:
        """Return the cost of `plan` from `initial` (nz, nx) and, if asked, its gradient.

        The arguments are those of `schedule_cost`, and `learnt` acts beside the effects. `patience`
        is not used, because nothing waits.

        Raises:
            InputError: as `schedule_cost` and `on`.
        """
        del patience
        nz, nx = initial.shape
        model = self.on(self.own.rig.grid(nx, nz), learnt)
        found = schedule_cost(
            model, initial, plan, horizon=horizon, terms=terms, with_gradient=with_gradient
        )
        return found.cost, found.gradient
