"""The physics-based model for one interval: predict, residual, correct (paper sec. 2.2)."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.effect_parameter import onset
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.quantities import quantity_of_interest
from porotwin_solver.coefficients.refinement import coarsen, refine
from porotwin_solver.effects import acting, described_physics, observation_operator
from porotwin_solver.model.engine import PROCESSOR, Engine, State
from porotwin_solver.model.presets import preset_named
from porotwin_solver.model.supervision import UNSUPERVISED, Supervision


class Prediction(NamedTuple):
    """A prediction (nz, nx) [-] and the arguments that led to it.

    `previous` (nz, nx) [-] is the state before, `rates` are those of the wells [m^3/s], `time_step`
    is [s].
    """

    previous: FloatArray
    rates: tuple[tuple[str, WellRate], ...]
    time_step: float
    predicted: FloatArray

    def answers(self, previous: FloatArray, rates: WellRates, time_step: float) -> bool:
        """Return whether the arguments are the same, to the last bit of every number.

        `previous` (nz, nx) [-]; `rates` [m^3/s] by well; `time_step` [s].
        """
        return (
            self.time_step == time_step
            and self.rates == tuple(rates.items())
            and np.array_equal(self.previous.view(np.int64), previous.view(np.int64))
        )


class Model:
    """The rig's physics on one grid, solved for one interval at a time.

    P is the propagator: it maps a state to the state `time_step` later. The operator of the paper
    is, for the scheme that runs,

        L c = phi (c^(n+1) - P c^n) / dt + f_c,

    so that

    - L c = f_c is the prediction, c^(n+1) = P c^n;
    - the residual of an observed pair is r = L c - f_c = phi (c^(n+1) - P c^n) / dt (paper eq.
      costa_residual2);
    - the solution of L c = f_c + sigma is c^(n+1) = P c^n + dt sigma / phi.

    This holds for a limited, nonlinear P and any number of inner steps. For small dt it tends to
    phi dc/dt + div(q c). phi is the porosity times the retardation factor. sigma is a density per
    rig volume [1/s].

    All effects act in a prediction, also those with an onset, which is past. A free run takes the
    model `at` each time.

    The model keeps its latest prediction, which `residual` and `correct` use again. One model
    serves one thread at a time.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        preset: str = 'accurate',
        effects: Iterable[EffectDescription] = (),
        refinement: int | None = None,
        supervision: Supervision = UNSUPERVISED,
        adapt: Callable[[Physics], Physics] = lambda physics: physics,
        device: str = PROCESSOR,
    ) -> None:
        """Prepare the flow of `rig` with its own and further `effects` on `grid`.

        Flow and transport are solved on cells whose sides are divided into `refinement` parts; the
        preset decides where it is not given. The tracer-driven part of the flow is on `grid`.
        `supervision` bounds every prediction. `adapt` changes the coefficients after the effects.
        `device` is as in `Engine`.

        Raises:
            InputError: an unknown preset, effect, parameter or device, or coefficients no rig can
                have.
        """
        chosen = preset_named(preset)
        described = (*rig.effects, *effects)
        self.rig, self.grid, self.preset = rig, grid, preset
        self.effects = described
        self.observation_operator = observation_operator(described)
        self.physics = fine_physics = adapt(described_physics(rig, grid, effects))
        if (factor := refinement or chosen.refinement(grid)) > 1:
            fine_physics = adapt(described_physics(rig, grid.refined(factor), effects))
            if fine_physics.is_coupled:  # its flow is solved on the coarser grid
                fine_physics = replace(fine_physics, blocks=factor)
        self.engine = Engine(
            fine_physics,
            scheme=chosen.scheme,
            coupled_physics=self.physics,
            supervision=supervision,
            device=device,
        )
        self._at: dict[tuple[str, ...], Model] = {}
        self._made_with = partial(
            Model,
            rig.model_copy(update={'effects': ()}),
            grid,
            preset=preset,
            refinement=refinement,
            supervision=supervision,
            adapt=adapt,
            device=device,
        )
        self._storage_per_volume = self.physics.porosity * self.physics.retardation_factor
        self._latest: Prediction | None = None

    @property
    def onsets(self) -> tuple[float, ...]:
        """The times [s] at which effects begin, ascending."""
        return tuple(sorted({onset(one) for one in self.effects} - {0.0}))

    def at(self, time: float) -> 'Model':
        """Return the model with the effects that act at `time` [s]; these models are kept.

        Raises:
            InputError: as the model itself.
        """
        if not self.onsets or time >= self.onsets[-1]:
            return self
        effects = acting(self.effects, time)
        key = tuple(map(repr, effects))
        if key not in self._at:
            self._at[key] = self._made_with(effects=effects)
        return self._at[key]

    def prepare(self) -> None:
        """Load the compiled kernels and solve the unit flows ahead of the first request.

        Raises:
            InputError: the iterative solver for large grids does not converge.
        """
        self.engine.prepare()
        levels = dict.fromkeys(self.physics.levels, WellRate())
        self.predict(self.initial_condition(), levels, 1.0)

    def initial_condition(self) -> FloatArray:
        """Return the map before any tracer is injected: zeros, (nz, nx)."""
        return np.zeros(self.grid.shape)

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the map (nz, nx) at `time_step` [s] after `concentration`, at constant `rates`.

        The result stays within the range of `concentration` and of the injected concentrations.
        Mobile and immobile water start from the same concentration.

        Raises:
            InputError: NaN or another shape, an unknown well, rates that do not balance in a
                closed rig, a time step that is not positive, or the supervision refuses the cost.
        """
        start = self.validated_map(concentration, 'concentration')
        step = validated_duration(time_step, 'time step')
        state = State.equilibrium(refine(start, self.engine.grid.shape))
        self.engine.advance(state, rates, step)
        predicted = coarsen(self.engine.mean_concentration(state), self.grid.shape)
        # copies: the caller may change its arrays
        self._latest = Prediction(start.copy(), tuple(rates.items()), step, predicted.copy())
        return predicted

    def residual(
        self,
        previous: FloatArray,
        next_: FloatArray,
        rates: WellRates,
        time_step: float,
    ) -> FloatArray:
        """Return r = L c - f_c [1/s], (nz, nx), of an observed pair of maps.

        Simulates only if the latest prediction had other arguments.

        Raises:
            InputError: as `predict`.
        """
        observed = self.validated_map(next_, 'next')
        return self.source_of(observed - self._prediction(previous, rates, time_step), time_step)

    def source_of(self, change: FloatArray, time_step: float) -> FloatArray:
        """Return the sigma (nz, nx) [1/s] that adds `change` (nz, nx) [-] in one step [s]."""
        source: FloatArray = self._storage_per_volume * change / time_step
        return source

    def correct(
        self,
        previous: FloatArray,
        sigma: FloatArray,
        rates: WellRates,
        time_step: float,
    ) -> FloatArray:
        """Return the solution of L c = f_c + sigma, (nz, nx); not clipped.

        `sigma` (nz, nx) [1/s]. With the exact residual it is the observed map to round-off.
        Simulates only if the latest prediction had other arguments.

        Raises:
            InputError: as `predict`.
        """
        source = self.validated_map(sigma, 'sigma')
        predicted = self._prediction(previous, rates, time_step)
        return predicted + time_step * source / self._storage_per_volume

    def quantity_of_interest(self, name: str, concentration: FloatArray) -> float:
        """Return the quantity `name` (see `quantities`) of a map (nz, nx), in SI units.

        Raises:
            InputError: an unknown quantity, NaN or another shape.
        """
        values = self.validated_map(concentration, 'concentration')
        return quantity_of_interest(name, self.physics, values)

    def validated_map(self, values: FloatArray, name: str) -> FloatArray:
        """Return `values` as an array of floats (nz, nx).

        Raises:
            InputError: NaN, infinite or of another shape; the message begins with `name`.
        """
        array = np.asarray(values, dtype=float)
        if array.shape != self.grid.shape:
            raise InputError(
                f'{name}: a map of {array.shape} cells, the model has {self.grid.shape} '
                '(rows, columns); resample it'
            )
        if not np.isfinite(array).all():
            count = int(np.count_nonzero(~np.isfinite(array)))
            raise InputError(f'{name}: {count} cells are not finite; fill them first')
        return array

    def _prediction(self, previous: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the latest prediction if it had these arguments, else a new one. Read only."""
        start = self.validated_map(previous, 'concentration')
        if self._latest is not None and self._latest.answers(start, rates, time_step):
            return self._latest.predicted
        return self.predict(previous, rates, time_step)


def validated_duration(seconds: float, name: str) -> float:
    """Return a duration [s] as a float.

    Raises:
        InputError: it is not finite and positive; the message begins with `name`.
    """
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(f'{name} {seconds} s: must be positive')
    return float(seconds)
