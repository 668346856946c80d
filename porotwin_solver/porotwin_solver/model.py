"""The physics-based model as the twin asks it: predict, residual, correct (paper sec. 2.2)."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.wells import WellRates
from porotwin_solver.effects import apply_effects
from porotwin_solver.engine import Engine, State
from porotwin_solver.observation_operator import ObservationOperator
from porotwin_solver.physics import Physics, nominal_physics
from porotwin_solver.quantities import quantity_of_interest
from porotwin_solver.refinement import coarsen, refine
from porotwin_solver.transport import SUPERBEE, THIRD_ORDER, UPWIND

FINE_CELLS = 200_000
"""Cells up to which the accurate preset refines a grid."""

FINEST = 4
"""Most cells along each side into which it divides a cell; a power of two."""


@dataclass(frozen=True)
class Preset:
    """A scheme of `transport`, and whether it runs on a finer grid than asked for."""

    scheme: int
    refines: bool

    def refinement(self, grid: Grid) -> int:
        """Return into how many parts along each side the cells of `grid` are divided."""
        factor = 1
        while (
            self.refines and factor < FINEST and grid.nx * grid.nz * (2 * factor) ** 2 <= FINE_CELLS
        ):
            factor *= 2
        return factor


PRESETS: dict[str, Preset] = {
    'fast': Preset(SUPERBEE, refines=False),
    'accurate': Preset(THIRD_ORDER, refines=True),
    'upwind': Preset(UPWIND, refines=False),
}
"""The live loop and the optimiser; simulation, training, diagnosis; the paper's diffusive model."""


def preset_named(name: str) -> Preset:
    """Return the preset `name`.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    if name not in PRESETS:
        raise InputError(f"preset '{name}': unknown; choose from {', '.join(PRESETS)}")
    return PRESETS[name]


class Model:
    """The rig's physics on one grid, asked for one interval at a time.

    P is the propagator: what the scheme makes of a state within `time_step`. The operator of the
    paper, in the sense of the scheme that runs, is

        L c = phi (c^(n+1) - P c^n) / dt + f_c,

    so that L c = f_c is the prediction, r = L c - f_c = phi (c^(n+1) - P c^n) / dt the residual of
    an observed pair (paper eq. costa_residual2), and L c = f_c + sigma solved by
    c^(n+1) = P c^n + dt sigma / phi. This holds for limited, nonlinear P and any number of inner
    steps alike; for small dt it tends to phi dc/dt + div(q c). phi is the porosity, times the
    retardation factor where tracer sorbs. sigma is a density per rig volume [1/s].

    Not for two threads at once: give each its own.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        preset: str = 'accurate',
        effects: Iterable[EffectDescription] = (),
        divisions: int | None = None,
    ) -> None:
        """Prepare the flow of `rig` with its own and further `effects` on `grid`.

        Water and tracer move on cells that are divided into `divisions` parts along each side, as
        the preset has it where that is not given; what the tracer adds to the flow is solved on
        those of `grid`.

        Raises:
            InputError: unknown preset, effect or parameter; fields no rig can have.
        """
        chosen = preset_named(preset)
        described = (*rig.effects, *effects)
        self.rig, self.grid, self.preset = rig, grid, preset
        self.effects = described
        self.nominal, self.operator = apply_effects(
            nominal_physics(rig, grid), ObservationOperator(), described
        )
        physics = self.nominal
        if (factor := divisions or chosen.refinement(grid)) > 1:
            fine = grid.refined(factor)
            physics, _ = apply_effects(nominal_physics(rig, fine), ObservationOperator(), described)
        self.engine = Engine(physics, scheme=chosen.scheme, coupled=self.nominal)
        self._storage = self.nominal.porosity * self.nominal.retardation_factor

    @property
    def physics(self) -> Physics:
        """The coefficients on `grid`, effects included."""
        return self.nominal

    def prepare(self) -> None:
        """Load the compiled kernels and solve the wells' flows ahead of the first question."""
        self.predict(self.initial_condition(), {}, 1.0)

    def initial_condition(self) -> FloatArray:
        """Return the map before any tracer is injected: zeros, (nz, nx)."""
        return np.zeros(self.grid.shape)

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the map (nz, nx) that `time_step` [s] under constant `rates` makes of another.

        Bounded by the range of `concentration` and of what is injected; moving and immobile water
        start from the same concentration.

        Raises:
            InputError: NaN or another shape, an unknown well, rates that do not balance in a
                closed rig, a time step that is not positive.
        """
        start = self.checked(concentration, 'concentration')
        step = _checked_step(time_step)
        state = State.at_rest(refine(start, self.engine.grid.shape))
        self.engine.advance(state, rates, step)
        return coarsen(self.engine.seen(state), self.grid.shape)

    def residual(
        self,
        previous: FloatArray,
        next_: FloatArray,
        rates: WellRates,
        time_step: float,
    ) -> FloatArray:
        """Return r = L c - f_c [1/s], (nz, nx), of an observed pair of maps."""
        observed = self.checked(next_, 'next')
        predicted = self.predict(previous, rates, time_step)
        return self._storage * (observed - predicted) / time_step

    def correct(
        self,
        previous: FloatArray,
        sigma: FloatArray,
        rates: WellRates,
        time_step: float,
    ) -> FloatArray:
        """Return the solution of L c = f_c + sigma, (nz, nx); not clipped.

        With the exact residual as `sigma` [1/s] this is the observed map to round-off.
        """
        source = self.checked(sigma, 'sigma')
        predicted = self.predict(previous, rates, time_step)
        return predicted + time_step * source / self._storage

    def quantity_of_interest(self, name: str, concentration: FloatArray) -> float:
        """Return the quantity `name` (see `quantities`) of a map (nz, nx), in SI."""
        values = self.checked(concentration, 'concentration')
        return quantity_of_interest(name, self.nominal, values)

    def checked(self, values: FloatArray, name: str) -> FloatArray:
        array = np.asarray(values, dtype=float)
        if array.shape != self.grid.shape:
            raise InputError(
                f'{name}: a map of {array.shape} cells, the model has {self.grid.shape} '
                '(rows, columns); resample it'
            )
        if not np.isfinite(array).all():
            count = int(np.count_nonzero(~np.isfinite(array)))
            raise InputError(f'{name}: {count} cells are not finite; fill them before asking')
        return array


def _checked_step(time_step: float) -> float:
    if not (math.isfinite(time_step) and time_step > 0):
        raise InputError(f'time step {time_step} s: must be positive')
    return float(time_step)
