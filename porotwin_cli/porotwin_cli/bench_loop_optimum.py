"""The best schedule of a scenario found offline, with the hidden effects and faults known.

It is the bound that a controller is compared with. Several starts are optimised by SLSQP on the
solver's adjoint; the virtual rig then tries them all, because it has numerics of its own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from porotwin_cli.bench_loop_rig import LoopRig, LoopSettings, delivered_rates
from porotwin_cli.bench_loop_scenarios import LoopScenario
from porotwin_core.grid import FloatArray
from porotwin_core.wells import Schedule, WellRates
from porotwin_hub.objective import WeightedTracer
from porotwin_hub.objective_registry import make_objective
from porotwin_hub.setpoint_limits import Limits
from porotwin_solver.adjoint import gradient
from porotwin_solver.effects import EFFECTS

PIECE_S = 480.0
"""Length of a piece of constant rates [s]: shorter ones hardly lower the dose."""

COST_INTERVAL_S = 120.0
"""Time between the maps whose tracer in the zone is summed up [s]."""

OPTIMUM_CELL_M = 0.01
"""Width of the cells of the offline optimisation [m]: a gradient takes a fifth of a second."""

STEPS = 25
"""Most steps of one search."""

FUZZY_SHARE = 0.02
"""Weight of the tracer near the zone in the cost: it shows the way where the dose is zero."""


def optimum_schedules(scenario: LoopScenario) -> Iterator[Schedule]:
    """Yield good schedules of the control wells: every start, and the best one near it."""
    search = _Search(scenario)
    for start in search.starts():
        yield search.schedule(search.within(start))
        yield search.from_start(start)


def play(scenario: LoopScenario, schedule: Schedule, settings: LoopSettings) -> LoopRig:
    """Return the rig after the experiment under `schedule`, set on time and as it says."""
    rig = LoopRig(scenario, settings)
    while not rig.is_over:
        rig.advance(schedule.at(rig.time))
    return rig


class _Search:
    """The dose of piecewise constant rates on the solver, and its gradient."""

    def __init__(self, scenario: LoopScenario) -> None:
        known = tuple(effect for effect in scenario.effects if effect.name in EFFECTS)
        self._scenario = scenario
        self._effects = known
        self._limits = Limits.of(scenario.rig)
        self._grid = scenario.rig.default_grid(OPTIMUM_CELL_M)
        objective = make_objective(scenario.rig, self._grid)
        if not isinstance(objective, WeightedTracer):
            raise TypeError(f'no linear cost: {objective.goal}')
        self._weights = objective.disallowed + FUZZY_SHARE * objective.weights
        count = max(1, round((scenario.end - scenario.start) / PIECE_S))
        edges = np.linspace(scenario.start, scenario.end, count + 1)
        step = scenario.photo_interval
        self._edges = scenario.start + step * np.round((edges - scenario.start) / step)
        self._times = np.arange(scenario.start, scenario.end + 1.0, COST_INTERVAL_S)
        self.runs = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Number of pieces and of control wells."""
        return len(self._edges) - 1, len(self._limits.wells)

    def starts(self) -> Iterator[FloatArray]:
        """Yield first shares of the largest rate, (pieces, wells): each well alone, then all."""
        wells = self.shape[1]
        for first in range(wells):
            shares = np.zeros(self.shape)
            shares[:, first] = 1.0
            yield shares
        even = np.full(self.shape, 1.0 / wells)
        yield even

    def from_start(self, start: FloatArray) -> Schedule:
        """Return the schedule of least dose near `start` (pieces, wells), shares of max_rate."""
        pieces, wells = self.shape
        most = self._limits.max_total_rate / self._limits.max_rate
        sums = np.kron(np.eye(pieces), np.ones(wells))
        start = self.within(start)
        scale = max(self._cost(start)[0], 1e-9)

        def cost(x: FloatArray) -> tuple[float, FloatArray]:
            value, slope = self._cost(np.clip(x.reshape(self.shape), 0.0, 1.0))
            return value / scale, slope.ravel() / scale

        found = minimize(
            cost,
            start.ravel(),
            jac=True,
            method='SLSQP',
            bounds=[(0.0, 1.0)] * start.size,
            constraints=[LinearConstraint(sums, -np.inf, most)],
            options={'maxiter': STEPS, 'ftol': 1e-4},
        )
        return self.schedule(np.clip(found.x.reshape(self.shape), 0.0, 1.0))

    def within(self, shares: FloatArray) -> FloatArray:
        """Return `shares` (pieces, wells) scaled down to the limit of all wells together."""
        most = self._limits.max_total_rate / self._limits.max_rate
        return shares / np.maximum(1.0, shares.sum(axis=1, keepdims=True) / most)

    def schedule(self, shares: FloatArray) -> Schedule:
        """Return commands that make the wells deliver `shares`, as far as the limits allow."""
        before = [(0.0, self._limits.safe())] if self._scenario.start > 0.0 else []
        return Schedule.from_rates([*before, *((t, rates) for t, rates in self._commands(shares))])

    def _commands(self, shares: FloatArray) -> list[tuple[float, WellRates]]:
        return [
            (float(edge), self._limits.setpoint(row * self._limits.max_rate))
            for edge, row in zip(self._edges, shares, strict=False)
        ]

    def _delivered(self, shares: FloatArray) -> Schedule:
        """Return the delivered part of the commands; the faults are known here."""
        faults = self._scenario.faults
        moments = {edge for fault in faults for edge in (fault.start, fault.end)}
        times = sorted({*self._edges[:-1], *(m for m in moments if 0.0 < m < self._scenario.end)})
        commands = Schedule.from_rates(
            [(0.0, self._limits.safe()), *self._raw(shares)]
            if self._scenario.start > 0.0
            else self._raw(shares)
        )
        times = sorted({0.0, *map(float, times)})
        return Schedule.from_rates(
            [(time, delivered_rates(commands.at(time), faults, time)) for time in times]
        )

    def _raw(self, shares: FloatArray) -> list[tuple[float, WellRates]]:
        """Return the commands without the rounding of the pumps, which has no slope."""
        unrounded = replace(self._limits, max_total_rate=np.inf)
        return [
            (float(edge), unrounded.setpoint(row * self._limits.max_rate))
            for edge, row in zip(self._edges, shares, strict=False)
        ]

    def _cost(self, shares: FloatArray) -> tuple[float, FloatArray]:
        """Return the dose [m^3 s] and its derivatives by `shares` (pieces, wells)."""
        self.runs += 1
        schedule = self._delivered(shares)
        found = gradient(
            self._scenario.rig,
            schedule,
            self._times,
            lambda _, values: (float(np.vdot(self._weights, values)), self._weights),
            grid=self._grid,
            effects=self._effects,
        )
        slope = np.zeros(self.shape)
        producer = self._limits.producer
        for index, (begin, _) in enumerate(found.intervals):
            piece = int(np.searchsorted(self._edges, begin + 1e-6, side='right')) - 1
            if piece < 0 or piece >= self.shape[0]:
                continue
            taken = found.rate[producer][index] * self._share(producer, begin) if producer else 0.0
            for number, well in enumerate(self._limits.wells):
                own = found.rate[well][index] * self._share(well, begin)
                slope[piece, number] += self._limits.max_rate * (own - taken)
        return found.cost * COST_INTERVAL_S, slope * COST_INTERVAL_S

    def _share(self, well: str, time: float) -> float:
        """Return the share that a pump delivers at `time` [s]."""
        shares: Sequence[float] = [
            fault.share
            for fault in self._scenario.faults
            if fault.well == well and fault.start <= time < fault.end
        ]
        return float(np.prod(shares))
