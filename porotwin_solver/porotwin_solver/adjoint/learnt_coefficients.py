"""Models with learnt physics, for training COSTA through free runs and for its corrections."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import Place
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import Rig
from porotwin_solver.adjoint.adjoint_state import AdjointState
from porotwin_solver.adjoint.step_adjoint import flow_adjoint, step_adjoint
from porotwin_solver.coefficients.refinement import coarsen_adjoint, refine
from porotwin_solver.effects import EFFECTS, effect, physics_on_top
from porotwin_solver.effects.definition.candidate import Candidate, SearchContext
from porotwin_solver.model.engine import State
from porotwin_solver.model.implicit_model import ImplicitModel
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import IMPLICIT
from porotwin_solver.model.simulation import maps_of


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

    def learnable(
        self, duration: float, strongest_rate: float, place: Place | None = None
    ) -> list[Candidate]:
        """Return the effects that may be learnt, on top of what the model has of them.

        Args:
            duration: of the longest experiment [s].
            strongest_rate: largest absolute rate of a well [m^3/s].
            place: (x, z) [m]; the trials of effects at that place. None: effects without a place.
                At rest no map shows a place.
        """
        if place is not None and strongest_rate == 0.0:
            return []
        context = SearchContext(self._rig, self._grid, duration, strongest_rate=strongest_rate)
        found: list[Candidate] = []
        for one in EFFECTS.values():
            candidates = one.candidates(context) if one.is_learnable else []
            if not candidates or one.has_place != (place is not None):
                continue
            if place is not None and one.places is not None:
                found += one.places.trials(context, place)
            else:
                found.append(_on_top(candidates[0]))
        return found

    def light(self, learnt: LearntPhysics) -> LearntPhysics:
        """Return the `learnt` physics without effects that make runs several times as slow."""
        effects = learnt.effects
        kept = [e for e in effects if not effect(e.name).destabilises_fronts(e.parameters)]
        return replace(learnt, effects=tuple(kept))

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


def _on_top(candidate: Candidate) -> Candidate:
    """Return `candidate` as a change: without fixed numbers, and free to fall below nothing."""
    fixed = {name: value for name, value in candidate.fixed.items() if isinstance(value, str)}
    parameters = (
        replace(one, low=1.0 / one.high) if one.low == one.neutral == 1.0 else one
        for one in candidate.parameters
    )
    return replace(candidate, parameters=tuple(parameters), fixed=fixed)


def _steps(
    model: ImplicitModel, schedule: Schedule, times: FloatArray, state: FloatArray, start: float
) -> Iterator[FloatArray]:
    """Yield the maps at `times` [s]; one implicit step leads to each of them."""
    for before, time in zip([start, *times], times, strict=False):
        for low, high, rates in schedule.intervals(float(before), float(time)):
            state = model.predict(state, rates, high - low)
        yield state
