"""The dose of a scenario under any plan, on the solver's coarse grid, with all secrets known.

It serves to draw scenarios and to find the best plan offline. No controller has a part in it.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.basis.units import to_ml_min
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.delivered_rates import delivered
from porotwin_core.rates.wells import RateStep, WellRate, WellRates, net_rate
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.objectives.objective import WeightedTracer
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_solver.adjoint.schedule_cost import schedule_cost
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.model import Model

CELL_M = 0.015
"""Width of the cells [m]: with smaller ones the limiter leaves kinks in the dose, and searches end
there (docs/control.md)."""

PRESET = 'fast'
"""Numerical scheme: of second order, which makes up for coarse cells."""

FUZZY_SHARE = 0.02
"""Weight of the tracer near the zone in the cost: it shows the way where the dose is zero."""


class Plan(NamedTuple):
    """Rates of the control wells (pieces, wells) [m^3/s], from `starts` (pieces,) [s] on, which
    count from the moment when the twin takes over."""

    starts: FloatArray
    rates: FloatArray


class ScenarioDose:
    """Tells the dose of plans in a scenario.

    Attributes:
        limits: of the rates.
        duration: from the moment when the twin takes over to the end [s].
    """

    def __init__(self, scenario: LoopScenario, *, cell: float = CELL_M) -> None:
        """Prepare the model, of this `cell` [m], with the effects of `scenario` that it knows.

        Raises:
            TypeError: the objective is no weighted sum of tracer.
        """
        rig = scenario.rig
        self.limits = Limits.of(rig)
        self.duration = scenario.end - scenario.start
        self._scenario, self._closed = scenario, rig.closed
        known = tuple(effect for effect in scenario.effects if effect.name in EFFECTS)
        self._model = Model(rig, rig.default_grid(cell), preset=PRESET, effects=known)
        objective = make_objective(rig, self._model.grid)
        if not isinstance(objective, WeightedTracer):
            raise TypeError(f'no linear cost: {objective.goal}')
        self._disallowed = objective.disallowed
        self._shown_way = objective.disallowed + FUZZY_SHARE * objective.weights
        self._initial = self._state_at_takeover()

    def dose(self, plan: Plan) -> float:
        """Return the dose of a plan [ml min]."""
        return self._cost(plan, self._disallowed, with_gradient=False)[0]

    def cost(self, plan: Plan) -> tuple[float, FloatArray]:
        """Return the dose with a small share of the fuzzy cost [ml min], and its derivatives.

        The derivatives are by the rates of the plan (pieces, wells) [ml min s/m^3].
        """
        return self._cost(plan, self._shown_way, with_gradient=True)

    def _cost(
        self, plan: Plan, weights: FloatArray, *, with_gradient: bool
    ) -> tuple[float, FloatArray]:
        steps = self._steps(plan)
        found = schedule_cost(
            self._model,
            self._initial,
            steps,
            horizon=self.duration,
            terms=[CostTerm(0.0, self.duration, linear=weights)],
            with_gradient=with_gradient,
        )
        slope = np.zeros(plan.rates.shape)
        if found.gradient is not None:
            for step, by_rate in zip(steps, found.gradient, strict=True):
                piece = int(np.searchsorted(plan.starts, step.start + 1e-9, side='right')) - 1
                slope[piece] += self._by_control(step.start, by_rate)
        return to_ml_min(found.cost), to_ml_min(1.0) * slope

    def _by_control(self, start: float, by_rate: FloatArray) -> FloatArray:
        """Return the derivatives by the commanded control rates (wells,) in one step."""
        limits, shares = self.limits, self._shares(start)
        own = np.array([shares.get(name, 1.0) for name in limits.wells])
        found = own * by_rate[[limits.all_wells.index(name) for name in limits.wells]]
        if limits.producer is None:
            return found
        taken = by_rate[limits.all_wells.index(limits.producer)]
        return found - taken * (own if self._closed else shares.get(limits.producer, 1.0))

    def _steps(self, plan: Plan) -> list[RateStep]:
        """Return the delivered rates of all wells; they change with the plan and the faults."""
        begin = self._scenario.start
        edges = {
            edge - begin
            for fault in self._scenario.faults
            for edge in (fault.start, fault.end)
            if begin < edge < self._scenario.end
        }
        moments = sorted({*map(float, plan.starts), *edges})
        pieces = np.searchsorted(plan.starts, np.array(moments) + 1e-9, side='right') - 1
        return [
            RateStep(moment, self._delivered(plan.rates[piece], moment))
            for moment, piece in zip(moments, pieces, strict=True)
        ]

    def _delivered(self, control_rates: FloatArray, moment: float) -> dict[str, WellRate]:
        rates = self._commanded(control_rates)
        return delivered(rates, self._shares(moment), closed=self._closed)

    def _commanded(self, control_rates: FloatArray) -> WellRates:
        """Return the rates of all wells, without the steps of the pumps, which have no slope."""
        limits = self.limits
        chosen = {
            name: WellRate(float(rate))
            for name, rate in zip(limits.wells, control_rates, strict=True)
        }
        rates = {**dict.fromkeys(limits.all_wells, WellRate()), **limits.fixed, **chosen}
        if limits.producer is not None:
            rates[limits.producer] = WellRate(-net_rate(rates))
        return rates

    def _shares(self, moment: float) -> dict[str, float]:
        """Return the share that each faulty pump delivers, `moment` [s] after the takeover."""
        time = self._scenario.start + moment
        shares: dict[str, float] = {}
        for fault in self._scenario.faults:
            if fault.start <= time < fault.end:
                shares[fault.well] = shares.get(fault.well, 1.0) * fault.share
        return shares

    def _state_at_takeover(self) -> FloatArray:
        state, start = self._model.initial_condition(), self._scenario.start
        faults = self._scenario.faults
        edges = {edge for fault in faults for edge in (fault.start, fault.end) if edge < start}
        for low, high in pairwise(sorted({0.0, *edges, start})):
            rates = self._delivered(np.zeros(len(self.limits.wells)), low - start)
            state = self._model.predict(state, rates, high - low)
        return state


def simple_plans(
    limits: Limits, duration: float, shares: Sequence[float]
) -> tuple[list[Plan], list[Plan]]:
    """Return constant plans, the first one without water, and plans that go over to another well.

    A constant plan runs some of the wells, each at the same rate, as much as the limits allow. The
    others go over from one well, or none, to another one at the given `shares` of the `duration`.
    """
    count = len(limits.wells)
    constant = []
    for chosen in range(2**count):
        wells = np.array([bool(chosen >> place & 1) for place in range(count)])
        rate = min(limits.max_rate, limits.max_total_rate / max(wells.sum(), 1))
        constant.append(rate * wells)
    single = [rates for rates in constant if np.count_nonzero(rates) <= 1]
    switched = [
        Plan(np.array([0.0, share * duration]), np.array([early, late]))
        for share in shares
        for early in single
        for late in single
        if (early != late).any()
    ]
    return [Plan(np.zeros(1), rates[None]) for rates in constant], switched
