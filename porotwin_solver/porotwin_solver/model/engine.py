"""Flow and transport combined: advances a state on one grid under constant rates."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import RateStep, WellRate, WellRates
from porotwin_solver.coefficients.cell_threads import THREADED_CELLS
from porotwin_solver.coefficients.face_field import FaceField, weighted_sum
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.refinement import coarsen, coarsen_adjoint
from porotwin_solver.coefficients.water_contact import WaterContact
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.flow.flow import SHARED_FLOWS, UNIT_FLOWS_KEPT
from porotwin_solver.flow.water_table import TableFlow
from porotwin_solver.model.coupling import Coupling
from porotwin_solver.model.supervision import UNSUPERVISED, Supervision
from porotwin_solver.transport.diffusion import Exchanges, diffuse, dispersive_exchanges
from porotwin_solver.transport.local_time_steps import TimeStepLevels, tape_length
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks, with_water
from porotwin_solver.transport.transport import (
    AdvectionTape,
    FluxAccumulators,
    Sources,
    advect,
    advection_levels,
)

LONGEST_STEP = 60.0
"""Longest splitting step [s]: between advection, diffusion and reaction, and between two solutions
of the flow where the tracer changes it. The splitting error is second order in it."""

PROCESSOR = 'cpu'
"""The device on which compiled kernels move the tracer, in threads."""

FLOW_UPDATES = 100
"""Updates of a cell that take as long as its share of a solution of the flow, roughly."""

EXCHANGES_KEPT = 4
"""Step lengths whose diffusion is kept; photographs at regular intervals need few."""


@dataclass
class State:
    """Concentrations (nz, nx), 0 water and 1 stock, of the mobile and the immobile pore water.

    `tracer_lost` (2,): volume of tracer stock [m^3] that left the rig through wells and leaks, and
    through open sides.
    """

    mobile: FloatArray
    immobile: FloatArray
    tracer_lost: FloatArray = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def equilibrium(cls, concentration: FloatArray) -> Self:
        """Return the state with `concentration` (nz, nx) in both mobile and immobile water."""
        return cls(concentration.copy(), concentration.copy())

    def copy(self) -> 'State':
        """Return an independent copy."""
        return State(self.mobile.copy(), self.immobile.copy(), self.tracer_lost.copy())


class StepCoefficients(NamedTuple):
    """The coefficients of one splitting step.

    flux: water through the faces [m^3/s].
    sources: water and tracer of wells, leaks and water bodies [m^3/s].
    levels: local time step levels of advection.
    exchanges: diffusive exchange between cells, for half the step.
    """

    flux: FaceField
    sources: Sources
    levels: TimeStepLevels
    exchanges: Exchanges

    @property
    def size(self) -> int:
        """The memory of the coefficients of advection [B]."""
        levels = self.levels.level.nbytes + self.levels.order.nbytes
        return levels + sum(part.nbytes for part in (*self.flux, *self.sources))


class StepRecord(NamedTuple):
    """The data of `Engine.step` for its adjoint.

    coefficients: of the step.
    last: the state after the last recorded part: after the second diffusion, or the advection.
    first_diffusion, advection, second_diffusion: the concentrations [-] before every substep. The
        tapes of diffusion have one number per cell and substep (see `tape_length`), or none.
    """

    coefficients: StepCoefficients
    last: State
    first_diffusion: FloatArray
    advection: AdvectionTape
    second_diffusion: FloatArray

    @property
    def size(self) -> int:
        """The memory of the record of an advection [B]."""
        last, tape = self.last, self.advection
        return last.mobile.nbytes + last.immobile.nbytes + tape.values.nbytes + tape.is_awake.nbytes


DURATION_DIGITS = 6
"""Digits of a duration [s] that matter for its cost."""


class Engine:
    """Advances a state of `physics` with one of the advection schemes.

    Where the tracer changes the flow, that part of the flow is solved on the grid of
    `coupled_physics` and interpolated to the faces of the finer grid (see `coupling`).

    It owns work arrays, so one engine serves one thread at a time.
    """

    def __init__(
        self,
        physics: Physics,
        *,
        scheme: Scheme,
        coupled_physics: Physics | None = None,
        supervision: Supervision = UNSUPERVISED,
        longest_step: float = LONGEST_STEP,
        device: str = PROCESSOR,
    ) -> None:
        """Factorise the flow of `physics`, which does not depend on the rates.

        The grid of `coupled_physics` equals the grid of `physics` or is coarser by a whole factor;
        by default it is the same. `supervision` bounds every call of `advance`. A splitting step
        takes at most `longest_step` [s]. The tracer moves on `device`: PROCESSOR, or a device of
        PyTorch such as 'cuda'; the flow is solved on the processor.

        Raises:
            InputError: this machine has no such device, or the wells lie outside the rig.
        """
        self.physics = physics
        self.scheme = scheme
        self.supervision = supervision
        self.longest_step = longest_step
        self.grid = physics.grid
        self.flow = SHARED_FLOWS.flow(self.grid, physics.mobility_thickness, physics.contact)
        self.sources_and_sinks = SourcesAndSinks(physics)
        self.storage = physics.storage * (1.0 - physics.immobile_fraction)
        self.background = None if physics.fringe is not None else background_flux(physics)
        self._per_metre: dict[str, FaceField] = {}
        coupled = coupled_physics if coupled_physics and physics.fringe is None else physics
        self.coupling = Coupling(coupled) if physics.is_coupled else None
        self._coupled, self._coupled_rises = coupled, [0.0] * len(physics.levels)
        self._coupling_refinement = self.grid.nx // coupled.grid.nx
        self._on_device = None
        if device != PROCESSOR:
            from porotwin_solver.transport.torch_transport import TorchTransport

            self._on_device = TorchTransport(device, scheme)
        self._accumulators = FluxAccumulators.zeros(self.grid)
        self._kept_table: tuple[WellRates, TableFlow] | None = None
        self._kept_exchanges: dict[float, Exchanges] = {}
        self._kept_rates: tuple[WellRates, Sources, FaceField] | None = None
        self._kept_step: tuple[float, WellRates, StepCoefficients] | None = None

    def prepare(self) -> None:
        """Solve the unit flows ahead of the first rates, where they hold for all rates.

        Raises:
            InputError: the iterative solver for large grids does not converge.
        """
        if self.physics.fringe is None:
            for source_sink in self.sources_and_sinks.all[:UNIT_FLOWS_KEPT]:
                self.flow.unit_flux(source_sink)

    def mean_concentration(self, state: State) -> FloatArray:
        """Return the mean over mobile and immobile water, (nz, nx): the camera sees this."""
        immobile = self.physics.immobile_fraction
        if immobile == 0:
            return state.mobile
        return (1 - immobile) * state.mobile + immobile * state.immobile

    @cached_property
    def unit_fluxes(self) -> FaceField:
        """The flux [m^3/s] of 1 m^3/s of pure water into each of `sources_and_sinks.all`.

        The sources and sinks are the first axis: `x` is (count, nz, nx + 1).
        """
        units = [self.flow.unit_flux(source_sink) for source_sink in self.sources_and_sinks.all]
        grid, count = self.grid, len(units)
        return FaceField(
            np.array([unit.x for unit in units]).reshape(count, grid.nz, grid.nx + 1),
            np.array([unit.z for unit in units]).reshape(count, grid.nz + 1, grid.nx),
        )

    def water_flux(self, rates: WellRates) -> FaceField:
        """Return the flux [m^3/s] of pure water: a superposition of unit flows, or below a table.

        Raises:
            InputError: an unknown well, or rates that do not balance in a rig without open side.
        """
        if self.physics.fringe is not None:
            return self.table(rates).flux
        active = self.sources_and_sinks.active(rates)
        if (net := self.physics.surplus(rates)) != 0.0:
            leaks = math.fsum(leak.rate for leak in self.physics.leaks)
            told = f', {to_ml_h(leaks):.6g} ml/h of them from leaks,' if leaks else ''
            effects = 'correct the effects, ' * bool(leaks or self.physics.rate_factors)
            raise InputError(
                f'rates add up to {to_ml_h(net):.6g} ml/h{told} in a rig whose sides are all '
                f'closed; {effects}balance injection and production, or open a side in rig.yaml'
            )
        pumped = np.zeros(len(self.sources_and_sinks.all))
        for source in active:
            pumped[self.sources_and_sinks.all.index(source.source_sink)] += source.rate
        if self.grid.nx * self.grid.nz < THREADED_CELLS:
            flux = FaceField(*(weighted_sum(pumped, units) for units in self.unit_fluxes))
        else:  # a second copy of all unit flows would take more memory than all the rest
            flux = FaceField.zeros(self.grid)
            for source_sink, rate in zip(self.sources_and_sinks.all, pumped, strict=True):
                if rate != 0.0:
                    flux = flux + self.flow.unit_flux(source_sink) * rate
        for name in self.physics.at_levels(rates).levels:
            if rates[name].rise != 0.0:
                flux = flux + self._flux_per_metre(name) * rates[name].rise
        return flux if self.background is None else flux + self.background

    def _flux_per_metre(self, name: str) -> FaceField:
        """Return the additional flux [m^2/s] per metre of rise of the water `name`."""
        if name not in self._per_metre:
            one = {level: WellRate(rise=float(level == name)) for level in self.physics.levels}
            raised = background_flux(self.physics.at_levels(one)) or FaceField.zeros(self.grid)
            described = self.background or FaceField.zeros(self.grid)
            self._per_metre[name] = raised + described * -1.0
        return self._per_metre[name]

    def table(self, rates: WellRates) -> TableFlow:
        """Return the steady water table at `rates`; the latest one is kept.

        Raises:
            InputError: it does not settle.
        """
        if self._kept_table is None or self._kept_table[0] != rates:
            found = TableFlow(
                self.physics.at_levels(rates), self.sources_and_sinks.sources(rates).net
            )
            self._kept_table = dict(rates), found
        return self._kept_table[1]

    def contact(self, rates: WellRates) -> WaterContact:
        """Return the contact of the sand with water at `rates`."""
        physics = self.physics if self.physics.fringe is None else self.table(rates).physics
        return physics.contact

    def flux_per_rate(self, rates: WellRates) -> FaceField:
        """Return dflux per rate into each of `sources_and_sinks.all`, as `unit_fluxes`."""
        if self.physics.fringe is None:
            return self.unit_fluxes
        table, places = self.table(rates), self.sources_and_sinks
        found = [table.flux_per_source(places.spread(place)) for place in places.all]
        return FaceField(np.array([one.x for one in found]), np.array([one.z for one in found]))

    def _prepare_coupling(self, rates: WellRates) -> None:
        """Let the tracer-driven flow take water table and levels of `rates`; it moves none."""
        if self.coupling is None:
            return
        if self.physics.fringe is not None:
            table = self.table(rates)
            if self.coupling.physics is not table.physics:
                self.coupling = Coupling(table.physics)
            return
        rises = [rates[name].rise for name in sorted(self.physics.at_levels(rates).levels)]
        if rises != self._coupled_rises:
            self.coupling = Coupling(self._coupled.at_levels(rates))
            self._coupled_rises = rises

    def coupled_flux(self, water: FaceField, rates: WellRates, mobile: FloatArray) -> FaceField:
        """Return the flux [m^3/s] with the tracer `mobile` (nz, nx), from the flux of pure `water`.

        Raises:
            InputError: the pressure does not converge (see `Coupling.flux`).
        """
        if self.coupling is None:
            return water
        self._prepare_coupling(rates)
        coarse = coarsen(mobile, self.coupling.grid.shape)
        return water + self.coupling.flux(rates, coarse).refined(self._coupling_refinement)

    def coupled_flux_adjoint(
        self, rates: WellRates, mobile: FloatArray, bar: FaceField
    ) -> tuple[FloatArray, FloatArray]:
        """Return dJ/dmobile (nz, nx) and dJ/dsource, through the tracer-driven part of the flux.

        `bar` is dJ/dflux of `coupled_flux`. The sources [m^3/s] are those on the coupling's grid.

        Raises:
            InputError: the iterative solver for large grids does not converge.
        """
        assert self.coupling is not None
        self._prepare_coupling(rates)
        coarse = coarsen(mobile, self.coupling.grid.shape)
        by_flux = bar.refined_adjoint(self._coupling_refinement)
        by_coarse, by_source = self.coupling.flux_adjoint(rates, coarse, by_flux)
        return coarsen_adjoint(by_coarse, self.grid.shape), by_source

    def splitting(self, duration: float, longest_step: float | None = None) -> tuple[int, float]:
        """Return the number of splitting steps in `duration` [s] and their length [s].

        Without `longest_step` [s], the engine's own longest step holds.
        """
        longest = self.longest_step if longest_step is None else longest_step
        count = max(1, math.ceil(duration / longest - ROUND_OFF))
        return count, duration / count

    def coefficients(self, state: State, rates: WellRates, length: float) -> StepCoefficients:
        """Return the coefficients of a step of `length` [s] from `state`.

        Raises:
            InputError: as `water_flux` and `coupled_flux`.
        """
        sources, water = self._of_rates(rates)
        flux = self.coupled_flux(water, rates, state.mobile)
        sources = with_water(self.physics, self.contact(rates), flux, sources)
        return StepCoefficients(
            flux,
            sources,
            advection_levels(flux, sources, self.storage, length),
            self.exchanges(flux, 0.5 * length),
        )

    def interval(
        self,
        state: State,
        rates: WellRates,
        duration: float,
        longest_step: float | None = None,
    ) -> Iterator[StepCoefficients]:
        """Yield the coefficients of every splitting step in `duration` [s] under constant `rates`.

        `longest_step` is as in `splitting`.
        The caller advances `state` by `step` before it takes the next ones. They change from step
        to step only where the tracer changes the flow.

        Raises:
            InputError: as `water_flux` and `coupled_flux`.
        """
        count, length = self.splitting(duration, longest_step)
        if self.coupling is None:
            yield from itertools.repeat(self._uncoupled_coefficients(state, rates, length), count)
            return
        for _ in range(count):
            yield self.coefficients(state, rates, length)

    def _of_rates(self, rates: WellRates) -> tuple[Sources, FaceField]:
        """Return the sources and the flux of pure water at `rates`; the latest ones are kept.

        Rates seldom change from one photograph to the next.

        Raises:
            InputError: as `water_flux`.
        """
        kept = self._kept_rates
        if kept is None or kept[0] != rates:
            self._kept_rates = kept = None  # frees memory before the new ones need it
            sources, water = self.sources_and_sinks.sources(rates), self.water_flux(rates)
            self._kept_rates = kept = dict(rates), sources, water
        return kept[1], kept[2]

    def _uncoupled_coefficients(
        self, state: State, rates: WellRates, length: float
    ) -> StepCoefficients:
        """Return the coefficients where the tracer does not change the flow.

        The latest ones are kept.
        """
        kept = self._kept_step
        if kept is not None and kept[:2] == (length, rates):
            return kept[2]
        self._kept_step = kept = None  # frees memory before the new ones need it
        found = self.coefficients(state, rates, length)
        self._kept_step = (length, dict(rates), found)
        return found

    def advance(
        self,
        state: State,
        rates: WellRates,
        duration: float,
        longest_step: float | None = None,
    ) -> None:
        """Advance `state` in place by `duration` [s] under constant `rates`.

        `longest_step` is as in `splitting`.

        Raises:
            InputError: as `water_flux` and `coupled_flux`, or the supervision refuses the cost.
        """
        self.supervision.refuse_too_long(duration)
        for coefficients in self.supervised_interval(state, rates, duration, longest_step):
            self.step(state, coefficients)

    def supervised_interval(
        self,
        state: State,
        rates: WellRates,
        duration: float,
        longest_step: float | None = None,
    ) -> Iterator[StepCoefficients]:
        """Yield as `interval`, with a check before every step.

        Where the tracer changes the flow, a later step may cost far more than the first one: an
        empty rig has no density flow. So the cost of the whole interval is estimated anew at every
        step with another flow.

        Raises:
            InputError: as `interval`, or the supervision refuses the cost.
        """
        count, _ = self.splitting(duration, longest_step)
        latest, each, done = None, 0, 0
        steps = self.interval(state, rates, duration, longest_step)
        for number, coefficients in enumerate(steps):
            if coefficients is not latest:
                latest, each = coefficients, self._step_updates(coefficients)
                self.supervision.refuse_too_costly(done + (count - number) * each, duration)
            done += each
            self.supervision.check()
            yield coefficients

    def cell_updates(self, coefficients: StepCoefficients, duration: float) -> int:
        """Return the updates of single cells in `duration` [s], from those of its first step."""
        count, _ = self.splitting(duration)
        return count * self._step_updates(coefficients)

    def _step_updates(self, coefficients: StepCoefficients) -> int:
        """Return the updates of single cells in one splitting step.

        A solution of the flow that the tracer changes counts as FLOW_UPDATES for each cell.
        """
        advection = tape_length(coefficients.levels)
        diffusion = 2 * coefficients.exchanges.tape_length
        flow = FLOW_UPDATES * self.grid.nx * self.grid.nz if self.coupling is not None else 0
        return advection + diffusion + flow

    def refuse_too_costly(
        self,
        state: State,
        plan: Sequence[RateStep],
        intervals: Iterable[tuple[float, float, int]],
        *,
        runs: int = 1,
    ) -> None:
        """Return if a whole `plan` from `state` may be run `runs` times; nothing is advanced.

        Args:
            state: where it starts.
            plan: its steps.
            intervals: (start [s], end [s], number of the step), as of `plan_intervals`.
            runs: how often it is run.

        Raises:
            InputError: as `interval`, or the supervision refuses the cost.
        """
        if math.isinf(self.supervision.most_cell_updates):
            return
        known: dict[tuple[int, float], int] = {}
        updates, end = 0, 0.0
        for low, end, number in intervals:
            self.supervision.check()
            key = (number, round(end - low, DURATION_DIGITS))
            if key not in known:
                coefficients = next(self.interval(state, plan[number].rates, end - low))
                known[key] = self.cell_updates(coefficients, end - low)
            updates += known[key]
        self.supervision.refuse_too_costly(updates * runs, end)

    def step(self, state: State, coefficients: StepCoefficients) -> None:
        """Advance `state` in place by one splitting step.

        Half a step of reaction and diffusion, a step of advection, half a step of diffusion and
        reaction (Strang, SIAM J. Numer. Anal. 5 (1968) 506-517).
        """
        half = coefficients.exchanges.levels.duration
        self.react(state, half)
        self.transport(state, coefficients)
        self.react(state, half)

    def transport(self, state: State, coefficients: StepCoefficients) -> None:
        """Advance the mobile water in place: diffusion, advection, diffusion."""
        flux, sources, levels, exchanges = coefficients
        if self._on_device is not None:
            self._on_device.advance(
                state.mobile, self.storage, flux, sources, levels, exchanges, state.tracer_lost
            )
            return
        diffuse(state.mobile, self.storage, exchanges)
        self._advect(state, coefficients)
        diffuse(state.mobile, self.storage, exchanges)

    @property
    def on_device(self) -> bool:
        """Whether the tracer moves on a device of PyTorch."""
        return self._on_device is not None

    def recorded_step(
        self, state: State, coefficients: StepCoefficients, *, diffusion: bool
    ) -> StepRecord:
        """Do as `step` on the processor, and return the data for its adjoint.

        Without `diffusion`, only the advection is recorded.
        """
        exchanges = coefficients.exchanges
        half = exchanges.levels.duration
        room = exchanges.tape_length if diffusion else 0
        first, second = np.empty(room), np.empty(room)
        self.react(state, half)
        diffuse(state.mobile, self.storage, exchanges, tape=first)
        advection = self._advect(state, coefficients, record=True)
        assert advection is not None
        advected = state.copy()
        diffuse(state.mobile, self.storage, exchanges, tape=second)
        last = state.copy() if diffusion else advected
        self.react(state, half)
        return StepRecord(coefficients, last, first, advection, second)

    def _advect(
        self, state: State, coefficients: StepCoefficients, *, record: bool = False
    ) -> AdvectionTape | None:
        return advect(
            state.mobile,
            coefficients.flux,
            sources=coefficients.sources,
            storage=self.storage,
            levels=coefficients.levels,
            scheme=self.scheme,
            accumulators=self._accumulators,
            tracer_lost=state.tracer_lost,
            record=record,
        )

    def exchanges(self, flux: FaceField, duration: float) -> Exchanges:
        """Return the diffusive exchanges over `duration` [s].

        Without dispersion they do not depend on `flux`; the exchanges of the latest few durations
        are kept.
        """
        physics = self.physics
        if physics.disperses:
            return dispersive_exchanges(physics, flux, duration)
        found = self._kept_exchanges.pop(duration, None)
        if found is None:
            found = dispersive_exchanges(physics, flux, duration)
        self._kept_exchanges[duration] = found
        if len(self._kept_exchanges) > EXCHANGES_KEPT:
            del self._kept_exchanges[next(iter(self._kept_exchanges))]
        return found

    def react(self, state: State, duration: float) -> None:
        """Advance exchange with the immobile water and decay in place by `duration` [s], exactly.

        With the mean m, the gap g = mobile - immobile and the immobile fraction b:
        mobile = s (m + b e g), immobile = s (m - (1 - b) e g), s and e as `_reaction_factors`.
        """
        survival, gap_factor = self._reaction_factors(duration)
        immobile = self.physics.immobile_fraction
        if self._has_immobile_water:
            mean = (1.0 - immobile) * state.mobile + immobile * state.immobile
            gap = (state.mobile - state.immobile) * gap_factor
            state.mobile[:] = survival * (mean + immobile * gap)
            state.immobile[:] = survival * (mean - (1.0 - immobile) * gap)
        elif survival < 1.0:
            state.mobile *= survival
            state.immobile *= survival

    def react_adjoint(self, bar: State, duration: float) -> None:
        """Turn `bar` in place from dJ/d(state after `react`) into dJ/d(state before it)."""
        survival, gap_factor = self._reaction_factors(duration)
        immobile = self.physics.immobile_fraction
        if self._has_immobile_water:
            mean = bar.mobile + bar.immobile
            gap = gap_factor * (immobile * bar.mobile - (1.0 - immobile) * bar.immobile)
            bar.mobile[:] = survival * ((1.0 - immobile) * mean + gap)
            bar.immobile[:] = survival * (immobile * mean - gap)
        elif survival < 1.0:
            bar.mobile *= survival
            bar.immobile *= survival

    @property
    def _has_immobile_water(self) -> bool:
        """Whether immobile water is tracked; also at a fraction of 0, for the gradient there."""
        return self.physics.immobile_fraction > 0.0 or self.physics.exchange_rate > 0.0

    def _reaction_factors(self, duration: float) -> tuple[float, float]:
        """Return the factors by which decay reduces the tracer and exchange reduces the gap."""
        physics = self.physics
        exchanged = physics.exchange_rate * duration / (1.0 - physics.immobile_fraction)
        return math.exp(-physics.decay_rate * duration), math.exp(-exchanged)
