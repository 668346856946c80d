"""Flow and transport put together: a state, advanced under constant rates, on one grid."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRates
from porotwin_solver.background import background_flux
from porotwin_solver.coupling import Coupling
from porotwin_solver.diffusion import Exchanges, diffuse, exchanges
from porotwin_solver.flow import FaceField, flow_of
from porotwin_solver.physics import Physics
from porotwin_solver.refinement import coarsen, coarsen_adjoint
from porotwin_solver.sources_and_sinks import SourcesAndSinks
from porotwin_solver.transport import Carried, Pace, Sources, advect, pace

LONGEST_STEP = 60.0
"""Longest step [s] of the slowest cells, between advection and diffusion, and between two flows
where the tracer moves the water."""

STEPS_KEPT = 4
"""Lengths of step whose diffusion is kept: photographs at even times ask for few."""


@dataclass
class State:
    """Concentrations (nz, nx), 0 water, 1 stock: of the water that moves, and of what does not.

    `left`: volume of tracer stock [m^3] that left the rig through wells, leaks and open sides.
    """

    mobile: FloatArray
    immobile: FloatArray
    left: FloatArray = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def at_rest(cls, concentration: FloatArray) -> 'State':
        """Return the state in which moving and immobile water have the same concentration."""
        return cls(concentration.copy(), concentration.copy())

    def copy(self) -> 'State':
        """Return a state of its own."""
        return State(self.mobile.copy(), self.immobile.copy(), self.left.copy())


class Engine:
    """Advances a state of `physics` with one of the schemes of `transport`.

    Where the tracer moves the water, that part of the flow is solved on the grid of `coupled`, as
    fine or coarser by a whole factor, and shared out to the faces within (see `coupling`).
    """

    def __init__(self, physics: Physics, *, scheme: int, coupled: Physics | None = None) -> None:
        """Factorise the flow of `physics`; rates change nothing of that."""
        self.physics = physics
        self.scheme = scheme
        self.grid = physics.grid
        conductance = physics.depth * physics.permeability / physics.viscosity
        self.flow = flow_of(self.grid, conductance, physics.boundaries)
        self.sources_and_sinks = SourcesAndSinks(physics)
        self.storage = physics.storage * (1.0 - physics.immobile_fraction)
        self.background = background_flux(physics, conductance)
        self.coupling = Coupling(coupled or physics) if physics.is_coupled else None
        self.coupled_factor = self.grid.nx // (coupled or physics).grid.nx
        self._scratch = Carried.zeros(FaceField.zeros(self.grid))
        self._still: dict[float, Exchanges] = {}

    def seen(self, state: State) -> FloatArray:
        """Return the concentration that the camera sees: the mean of moving and immobile water."""
        share = self.physics.immobile_fraction
        return state.mobile if share == 0 else (1 - share) * state.mobile + share * state.immobile

    @cached_property
    def unit_fluxes(self) -> FaceField:
        """The flux [m^3/s] that 1 m^3/s into each of `sources_and_sinks.all` drives in pure water.

        Faces as in any `FaceField`, after one axis for the sources and sinks.
        """
        units = [self.flow.unit_flux(source_sink) for source_sink in self.sources_and_sinks.all]
        grid, count = self.grid, len(units)
        return FaceField(
            np.array([unit.x for unit in units]).reshape(count, grid.nz, grid.nx + 1),
            np.array([unit.z for unit in units]).reshape(count, grid.nz + 1, grid.nx),
        )

    def flux(self, rates: WellRates) -> FaceField:
        """Return the flux [m^3/s] in pure water: a superposition of unit flows.

        Raises:
            InputError: an unknown well, or rates that do not balance in a rig without open side.
        """
        told = self.sources_and_sinks.told(rates)
        net = math.fsum(rate for _, rate, _ in told)
        total = math.fsum(abs(rate) for _, rate, _ in told)
        if self.flow.closed and abs(net) > 1e-9 * total:
            raise InputError(
                f'rates add up to {to_ml_h(net):.6g} ml/h in a rig whose sides are all closed; '
                'balance injection and production, or open a side in rig.yaml'
            )
        pumped = np.zeros(len(self.sources_and_sinks.all))
        for source_sink, rate, _ in told:
            pumped[self.sources_and_sinks.all.index(source_sink)] += rate
        units = self.unit_fluxes
        flux = FaceField(np.tensordot(pumped, units.x, 1), np.tensordot(pumped, units.z, 1))
        return flux if self.background is None else flux + self.background

    def steps(self, duration: float) -> tuple[int, float]:
        """Return into how many steps of what length [s] a `duration` [s] is divided."""
        count = max(1, math.ceil(duration / LONGEST_STEP - 1e-9))
        return count, duration / count

    def advance(self, state: State, rates: WellRates, duration: float) -> None:
        """Advance `state` in place by `duration` [s] under constant `rates`.

        Half a step of reaction and diffusion, a step of advection, half a step of diffusion and
        reaction (Strang, SIAM J. Numer. Anal. 5 (1968) 506-517). Where the tracer moves the water,
        the flow is renewed before every step.
        """
        sources, water = self.sources_and_sinks.sources(rates), self.flux(rates)
        count, step = self.steps(duration)
        for index in range(count):
            if index == 0 or self.coupling is not None:
                flux = self.moving(water, rates, state.mobile)
                paces = pace(flux, sources, self.storage, step)
                pairs = self.exchanges(flux, 0.5 * step)
            self.step(state, flux, sources, steps=paces, pairs=pairs)

    def moving(self, water: FaceField, rates: WellRates, mobile: FloatArray) -> FaceField:
        """Return the flux [m^3/s]: that of pure `water`, and what the tracer `mobile` adds."""
        if self.coupling is None:
            return water
        coarse = coarsen(mobile, self.coupling.grid.shape)
        return water + self.coupling.flux(rates, coarse).refined(self.coupled_factor)

    def moving_adjoint(
        self, rates: WellRates, mobile: FloatArray, bar: FaceField
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives by `mobile` and by the sources on the grid of the coupling.

        `bar` holds those by the flux that `moving` returns; both through the tracer's part of it.
        """
        assert self.coupling is not None
        coarse = coarsen(mobile, self.coupling.grid.shape)
        by_flux = bar.refined_adjoint(self.coupled_factor)
        by_coarse, by_source = self.coupling.flux_adjoint(rates, coarse, by_flux)
        return coarsen_adjoint(by_coarse, self.grid.shape), by_source

    def step(
        self, state: State, flux: FaceField, sources: Sources, *, steps: Pace, pairs: Exchanges
    ) -> None:
        """Advance `state` in place by one step; `pairs` are those for half of it."""
        self.react(state, pairs.time_step)
        diffuse(state.mobile, self.storage, pairs)
        advect(
            state.mobile,
            flux,
            sources=sources,
            pore_volume=self.storage,
            steps=steps,
            scheme=self.scheme,
            scratch=self._scratch,
            left=state.left,
        )
        diffuse(state.mobile, self.storage, pairs)
        self.react(state, pairs.time_step)

    def exchanges(self, flux: FaceField, step: float) -> Exchanges:
        """Return the diffusion for `step` [s]; that without dispersion is kept for a few steps."""
        physics = self.physics
        if physics.disperses:
            return exchanges(physics, flux, step)
        found = self._still.pop(step, None) or exchanges(physics, flux, step)
        self._still[step] = found
        if len(self._still) > STEPS_KEPT:
            del self._still[next(iter(self._still))]
        return found

    @property
    def _exchanges_with_rest(self) -> bool:
        """Whether immobile water follows: also a share of 0, by which one may ask the gradient."""
        return self.physics.immobile_fraction > 0.0 or self.physics.exchange_rate > 0.0

    def react(self, state: State, duration: float) -> None:
        """Exchange with the immobile water and decay, both exactly, by `duration` [s]."""
        left, kept = self._reaction(duration)
        share = self.physics.immobile_fraction
        if self._exchanges_with_rest:
            mean = (1.0 - share) * state.mobile + share * state.immobile
            gap = (state.mobile - state.immobile) * kept
            state.mobile[:] = left * (mean + share * gap)
            state.immobile[:] = left * (mean - (1.0 - share) * gap)
        elif left < 1.0:
            state.mobile *= left
            state.immobile *= left

    def react_adjoint(self, bar: State, duration: float) -> None:
        """Turn `bar`, the derivative by the state after `react`, into that by the one before."""
        left, kept = self._reaction(duration)
        share = self.physics.immobile_fraction
        if self._exchanges_with_rest:
            mean = bar.mobile + bar.immobile
            gap = kept * (share * bar.mobile - (1.0 - share) * bar.immobile)
            bar.mobile[:] = left * ((1.0 - share) * mean + gap)
            bar.immobile[:] = left * (share * mean - gap)
        elif left < 1.0:
            bar.mobile *= left
            bar.immobile *= left

    def _reaction(self, duration: float) -> tuple[float, float]:
        """Return what decay leaves, and what exchange leaves of the gap to the immobile water."""
        physics = self.physics
        exchanged = physics.exchange_rate * duration / (1.0 - physics.immobile_fraction)
        return math.exp(-physics.decay_rate * duration), math.exp(-exchanged)
