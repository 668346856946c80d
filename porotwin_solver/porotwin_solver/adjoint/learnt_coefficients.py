"""Models with learnt physics, for training COSTA through free runs and for its corrections."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.adjoint_state import AdjointState
from porotwin_solver.adjoint.step_adjoint import flow_adjoint, step_adjoint
from porotwin_solver.coefficients.physics import Leak, Physics, SourceSink, check
from porotwin_solver.coefficients.refinement import coarsen_adjoint, refine
from porotwin_solver.model.engine import State
from porotwin_solver.model.implicit_model import ImplicitModel
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import IMPLICIT
from porotwin_solver.model.simulation import maps_of


def adapted(physics: Physics, learnt: LearntPhysics) -> Physics:
    """Return `physics` with the `learnt` changes.

    Raises:
        InputError: a leak or a patch lies outside the rig.
    """
    _check_patches(physics.grid, learnt)
    x, z = physics.background_flux
    by_x, by_z = learnt.background_flux
    leaks = tuple(Leak(SourceSink(leak.x, leak.z), leak.rate) for leak in learnt.leaks)
    along, across = learnt.longitudinal_dispersivity, learnt.transverse_dispersivity
    changed = replace(
        physics,
        permeability=physics.permeability * learnt.permeability_factor(physics.grid),
        density_difference=physics.density_difference + learnt.density_difference,
        longitudinal_dispersivity=physics.longitudinal_dispersivity + along,
        transverse_dispersivity=physics.transverse_dispersivity + across,
        background_flux=(x + by_x, z + by_z),
        retardation_factor=physics.retardation_factor * float(np.exp(learnt.log_retardation)),
        leaks=(*physics.leaks, *leaks),
    )
    check(changed)
    return changed


def _check_patches(grid: Grid, learnt: LearntPhysics) -> None:
    for number, patch in enumerate(learnt.patches, start=1):
        if not (0.0 <= patch.x <= grid.width and 0.0 <= patch.z <= grid.height):
            raise InputError(
                f'learnt physics, patch {number} at ({patch.x:.6g}, {patch.z:.6g}) m lies outside '
                f'the rig of {grid.width:g} x {grid.height:g} m; train again'
            )


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

    def __init__(
        self, rig: Rig, grid: Grid, preset: str, effects: Iterable[EffectDescription] = ()
    ) -> None:
        """Keep the description; `effects` are named ones beside those of the rig."""
        self._rig, self._grid, self._preset = rig, grid, preset
        self._effects = tuple(effects)

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
            effects=self._effects,
            adapt=partial(adapted, learnt=learnt),
        )

    def run(
        self,
        learnt: LearntPhysics,
        schedule: Schedule,
        times: FloatArray,
        *,
        initial: FloatArray,
        start: float,
    ) -> FloatArray:
        """Return the maps (times, nz, nx) of a free run at `times` [s].

        It begins at `start` [s] with the map `initial` (nz, nx).

        Raises:
            InputError: as `Model`, or the rates do not balance in a closed rig.
        """
        model = self.model(learnt)
        if isinstance(model, ImplicitModel):
            maps = _steps(model, schedule, times, initial, start)
        else:
            maps = maps_of(model, schedule, times, initial=initial, start=start)
        return np.array(list(maps)).reshape(-1, *self._grid.shape)


def _steps(
    model: ImplicitModel, schedule: Schedule, times: FloatArray, state: FloatArray, start: float
) -> Iterator[FloatArray]:
    """Yield the maps at `times` [s]; one implicit step leads to each of them."""
    for before, time in zip([start, *times], times, strict=False):
        for low, high, rates in schedule.intervals(float(before), float(time)):
            state = model.predict(state, rates, high - low)
        yield state
