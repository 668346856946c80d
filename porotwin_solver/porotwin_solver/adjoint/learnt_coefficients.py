"""Models with learnt physics, for training COSTA through free runs and for its corrections."""

from functools import partial

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_solver.adjoint.adjoint_state import AdjointState
from porotwin_solver.adjoint.step_adjoint import flow_adjoint, step_adjoint
from porotwin_solver.coefficients.refinement import coarsen_adjoint, refine
from porotwin_solver.effects import physics_on_top
from porotwin_solver.model.engine import State
from porotwin_solver.model.implicit_model import ImplicitModel
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import IMPLICIT


class AdjointModel(Model):
    """The model for one interval, with the adjoint of its step."""

    def step_adjoint(
        self, previous: FloatArray, rates: WellRates, time_step: float, bar: FloatArray
    ) -> FloatArray:
        """Return dJ/dprevious (nz, nx) of a cost J with `bar` = dJ/d(prediction) (nz, nx).

        It is exact where the preset does not refine the grid; else the slopes within the cells of
        `previous` are taken as given.

        The prediction is that of `predict` with these arguments, over `time_step` [s]. A source
        sigma adds dt sigma / phi to it, so that dJ/dsigma = dt / phi dJ/d(prediction).

        Raises:
            InputError: as `predict`.
        """
        engine = self.engine
        state = State.equilibrium(refine(previous, engine.grid.shape))
        _, length = engine.splitting(time_step)
        states = []
        for coefficients in engine.interval(state, rates, time_step):
            states.append(state.copy())
            engine.step(state, coefficients)
        backward = AdjointState.equilibrium(np.zeros(engine.grid.shape))
        backward.add_by_mean(engine, coarsen_adjoint(bar, engine.grid.shape))
        for before in states[::-1]:
            done = step_adjoint(engine, before, rates, length, backward)
            flow_adjoint(engine, before, rates, backward, done.derivatives)
        (nz, nx), whole = self.grid.shape, backward.mobile + backward.immobile
        blocks = whole.reshape(nz, whole.shape[0] // nz, nx, whole.shape[1] // nx)
        by_previous: FloatArray = blocks.sum(axis=(1, 3))
        return by_previous


class LearntModels:
    """Models of one rig, grid, preset and its effects with any learnt physics."""

    def __init__(self, rig: Rig, grid: Grid, preset: str) -> None:
        """Keep the description."""
        self._rig, self._grid, self._preset = rig, grid, preset

    def model(self, learnt: LearntPhysics) -> AdjointModel | ImplicitModel:
        """Return the model with the `learnt` physics and scheme.

        Raises:
            InputError: as `Model`.
        """
        preset = learnt.scheme or self._preset
        kind = ImplicitModel if preset == IMPLICIT else AdjointModel
        return kind(
            self._rig,
            self._grid,
            preset=preset,
            adapt=partial(physics_on_top, changes=learnt.effects),
        )
