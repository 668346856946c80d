"""Flow and transport put together: a state, advanced under constant rates, on one grid."""

import math
from dataclasses import dataclass

import numpy as np
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRates

from porotwin_solver.coupling import background_flux, coupled_flux, is_coupled
from porotwin_solver.diffusion import Exchanges, diffuse, exchanges
from porotwin_solver.discs import disc_shares
from porotwin_solver.flow import FaceField, Flow
from porotwin_solver.physics import Opening, Physics
from porotwin_solver.transport import Carried, Pace, Sources, advect, pace

LONGEST_STEP = 60.0
"""Longest step [s] of the slowest cells, and between advection and diffusion."""

LONGEST_COUPLED_STEP = 15.0
"""Longest step [s] between two flows where the tracer moves the water."""


@dataclass
class State:
    """Concentrations (nz, nx), 0 water, 1 stock: of the water that moves, and of what does not."""

    mobile: FloatArray
    immobile: FloatArray

    @classmethod
    def at_rest(cls, concentration: FloatArray) -> 'State':
        """Return the state in which moving and immobile water have the same concentration."""
        return cls(concentration.copy(), concentration.copy())


class Engine:
    """Advances a state of `physics` with one of the schemes of `transport`."""

    def __init__(self, physics: Physics, *, scheme: int) -> None:
        """Factorise the flow of `physics`; rates change nothing of that."""
        self.physics = physics
        self.scheme = scheme
        self.grid = physics.grid
        conductance = physics.depth * physics.permeability / physics.viscosity
        self.flow = Flow(self.grid, conductance, physics.boundaries)
        self.background = background_flux(physics, conductance)
        self.coupled = is_coupled(physics)
        self._storage = physics.storage * (1.0 - physics.immobile_fraction)
        self._still: Exchanges | None = None
        self._shares: dict[Opening, FloatArray] = {}
        self._unit_flux: dict[Opening, FaceField] = {}
        self._scratch = Carried.zeros(FaceField.zeros(self.grid))

    def sources(self, rates: WellRates) -> Sources:
        """Return what wells and leaks add to and take from every cell.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        inflow, tracer, outflow = (np.zeros(self.grid.shape) for _ in range(3))
        for opening, rate, concentration in self._rates(rates):
            share = self._share(opening)
            if rate > 0:
                inflow += rate * share
                tracer += rate * concentration * share
            else:
                outflow -= rate * share
        return Sources(inflow, tracer, outflow)

    def flux(self, rates: WellRates, mobile: FloatArray) -> FaceField:
        """Return the flux [m^3/s] through every face.

        A superposition of the wells' unit flows, unless the tracer, whose concentration in the
        moving water is `mobile` (nz, nx), moves the water too.

        Raises:
            InputError: an unknown well, or rates that do not balance in a rig without open side.
        """
        flux = FaceField.zeros(self.grid)
        told = self._rates(rates)
        net = math.fsum(rate for _, rate, _ in told)
        total = math.fsum(abs(rate) for _, rate, _ in told)
        if self.flow.closed and abs(net) > 1e-9 * total:
            raise InputError(
                f'rates add up to {to_ml_h(net):.6g} ml/h in a rig whose sides are all closed; '
                'balance injection and production, or open a side in rig.yaml'
            )
        if self.coupled:
            source = self.sources(rates).net
            return self.background + coupled_flux(self.flow, self.physics, source, mobile)
        for opening, rate, _ in told:
            unit = self._unit(opening)
            flux.x[:] += rate * unit.x
            flux.z[:] += rate * unit.z
        return flux + self.background

    def seen(self, state: State) -> FloatArray:
        """Return the concentration that the camera sees: the mean of moving and immobile water."""
        share = self.physics.immobile_fraction
        return state.mobile if share == 0 else (1 - share) * state.mobile + share * state.immobile

    def advance(self, state: State, rates: WellRates, duration: float) -> None:
        """Advance `state` in place by `duration` [s] under constant `rates`.

        Half a step of reaction and diffusion, a step of advection, half a step of diffusion and
        reaction (Strang, SIAM J. Numer. Anal. 5 (1968) 506-517); where the tracer moves the water,
        the flow is renewed before every step.
        """
        sources = self.sources(rates)
        longest = LONGEST_COUPLED_STEP if self.coupled else LONGEST_STEP
        count = max(1, math.ceil(duration / longest - 1e-9))
        step = duration / count
        flux = self.flux(rates, state.mobile)
        steps, pairs = self._paces(flux, sources, step)
        for index in range(count):
            if self.coupled and index > 0:
                flux = self.flux(rates, state.mobile)
                steps, pairs = self._paces(flux, sources, step)
            self._react(state, 0.5 * step)
            diffuse(state.mobile, self._storage, pairs)
            advect(
                state.mobile,
                flux,
                sources=sources,
                pore_volume=self._storage,
                steps=steps,
                scheme=self.scheme,
                scratch=self._scratch,
            )
            diffuse(state.mobile, self._storage, pairs)
            self._react(state, 0.5 * step)

    def _paces(self, flux: FaceField, sources: Sources, step: float) -> tuple[Pace, Exchanges]:
        steps = pace(flux, sources, self._storage, step)
        physics = self.physics
        if physics.longitudinal_dispersivity or physics.transverse_dispersivity:
            return steps, exchanges(physics, flux, 0.5 * step)
        if self._still is None or self._still.time_step != 0.5 * step:
            self._still = exchanges(physics, flux, 0.5 * step)
        return steps, self._still

    def _react(self, state: State, duration: float) -> None:
        """Exchange with the immobile water and decay, both exactly, by `duration` [s]."""
        physics = self.physics
        share = physics.immobile_fraction
        if share > 0.0:
            mean = self.seen(state)
            gap = (state.mobile - state.immobile) * math.exp(
                -physics.exchange_rate * duration / (1.0 - share)
            )
            state.mobile[:] = mean + share * gap
            state.immobile[:] = mean - (1.0 - share) * gap
        if physics.decay_rate > 0.0:
            left = math.exp(-physics.decay_rate * duration)
            state.mobile *= left
            state.immobile *= left

    def _rates(self, rates: WellRates) -> list[tuple[Opening, float, float]]:
        wells = self.physics.wells
        told = []
        for name, well in rates.items():
            if name not in wells:
                raise InputError(f"unknown well '{name}'; known: {', '.join(wells)}")
            rate = well.rate * self.physics.rate_factors.get(name, 1.0)
            if rate != 0.0:
                told.append((wells[name], rate, well.concentration))
        told.extend((leak.opening, leak.rate, 0.0) for leak in self.physics.leaks)
        return told

    def _share(self, opening: Opening) -> FloatArray:
        if opening not in self._shares:
            share = np.zeros(self.grid.nz * self.grid.nx)
            cells, parts = disc_shares(self.grid, opening.x, opening.z, opening.radius)
            share[cells] = parts
            self._shares[opening] = share.reshape(self.grid.shape)
        return self._shares[opening]

    def _unit(self, opening: Opening) -> FaceField:
        if opening not in self._unit_flux:
            self._unit_flux[opening] = self.flow.flux(self._share(opening))
        return self._unit_flux[opening]
