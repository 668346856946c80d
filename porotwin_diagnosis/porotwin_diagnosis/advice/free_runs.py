"""Free runs of a model with one thing changed, and the change that this makes in the maps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.refinement import refine
from porotwin_solver.model.engine import State
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import intervals, maps_of

Adapt = Callable[[Physics], Physics]
"""Returns physics with one thing changed."""

Window = tuple[float, float]
"""Begin and end of a part of the recording [s]."""


@dataclass(frozen=True, eq=False)
class FreeRuns:
    """Runs of the model of one recording with `given` effects, from the start to the end.

    Attributes:
        forward: the model of the recording, without a multifidelity correction.
        given: effects that every run has.
    """

    forward: Forward
    given: tuple[EffectDescription, ...] = ()

    @property
    def sample(self) -> Sample:
        """The frames of the recording."""
        return self.forward.sample

    @property
    def duration(self) -> float:
        """Time from the start of the model to the end of the recording [s]."""
        return max(self.sample.end - self.sample.model_start, 1e-9)

    @property
    def elapsed(self) -> FloatArray:
        """Time of each frame since the start of the model, relative to the duration, (nt, 1, 1)."""
        since = np.maximum(self.sample.times - self.sample.model_start, 0.0)
        return np.asarray(since / self.duration)[:, None, None]

    @cached_property
    def maps(self) -> FloatArray:
        """The maps (nt, nz, nx) [-] of the model with the given effects."""
        return self.forward.maps(self.given)

    def with_effects(self, *effects: EffectDescription) -> FloatArray:
        """Return the maps (nt, nz, nx) [-] with further `effects`.

        Raises:
            InputError: the model cannot run with these effects.
        """
        return self.forward.maps((*self.given, *effects))

    def at(self, times: NDArray[np.float64]) -> FloatArray:
        """Return the maps (n, nz, nx) [-] at other `times` [s], (n,)."""
        return self._another(replace(self.sample, times=times, fitted_frames=len(times)))

    def with_schedule(self, schedule: Schedule) -> FloatArray:
        """Return the maps (nt, nz, nx) [-] with other rates.

        Raises:
            InputError: rates that do not balance in a closed rig.
        """
        return self._another(replace(self.sample, schedule=schedule))

    def with_rig(self, rig: Rig, adapt: Adapt) -> FloatArray:
        """Return the maps (nt, nz, nx) [-] of another `rig` on as many cells.

        Raises:
            InputError: the model cannot run.
        """
        sample = self.sample
        model = self._model(rig, adapt)
        begin = self._initial(model)
        run = maps_of(model, sample.schedule, sample.times, initial=begin, start=sample.model_start)
        return np.stack(list(run))

    def changed_within(self, windows: Sequence[Window], adapt: Adapt) -> list[FloatArray]:
        """Return the maps (nt, nz, nx) [-] with changed physics in each of the `windows` alone.

        Raises:
            InputError: the model cannot run.
        """
        rig = self.sample.rig
        usual, changed = self._model(rig, lambda physics: physics), self._model(rig, adapt)
        return [self._switched(usual, changed, window) for window in windows]

    def _another(self, sample: Sample) -> FloatArray:
        """Return the maps of another recording of the same rig."""
        own = self.forward
        other = Forward(sample, preset=own.preset, refinement=own.refinement, crew=own.crew)
        return other.maps(self.given)

    def _model(self, rig: Rig, adapt: Adapt) -> Model:
        """Return the model of `rig` on as many cells, with physics that `adapt` changes."""
        grid = rig.grid(self.sample.grid.nx, self.sample.grid.nz)
        preset = self.forward.preset
        return Model(rig, grid, preset=preset, effects=self.given, refinement=1, adapt=adapt)

    def _initial(self, model: Model) -> FloatArray:
        """Return the first map (nz, nx) [-] of a run of `model`."""
        known = self.sample.initial_on(self.sample.grid)
        return model.initial_condition() if known is None else known

    def _switched(self, usual: Model, changed: Model, window: Window) -> FloatArray:
        """Return the maps of a run that takes the `changed` model within `window` [s]."""
        sample, offset = self.sample, usual.observation_operator.clock_offset
        state = State.equilibrium(refine(self._initial(usual), usual.engine.grid.shape))
        now, shown = sample.model_start, []
        for time in sample.times:
            target = time + offset
            cuts = sorted({now, max(now, target), *(c for c in window if now < c < target)})
            for low, high in pairwise(cuts):
                model = changed if window[0] <= low < window[1] else usual
                for start, end, engine, rates in intervals(model, sample.schedule, low, high):
                    step = longest_free_step(usual.engine.physics, rates)
                    engine.advance(state, rates, end - start, step)
            now = max(now, target)
            seen = usual.engine.mean_concentration(state)
            operator = usual.at(time).observation_operator
            shown.append(operator.apply(seen, sample.grid, float(time)))
        return np.stack(shown)
