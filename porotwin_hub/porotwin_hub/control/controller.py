"""The controllers: they choose the rates of the control wells by predictions (paper, section 4).

`Controller` is the paper's: constant rates over a horizon, found by COBYLA. `PlanController` in
`plan_controller` plans the whole rest of the experiment by gradients.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.rate_periods import plan_periods
from porotwin_core.rates.wells import RateStep, WellRates, mean_rates
from porotwin_hub.control import cobyla
from porotwin_hub.control.optimisation import Decision, Search, optimise
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.models.forecast import ModelUnavailable, PhysicsModel
from porotwin_hub.models.plant_knowledge import NOTHING_LEARNT, PlantKnowledge
from porotwin_hub.objectives.objective import Objective


class Planner(Protocol):
    """Chooses setpoints; the twin asks it once for every photograph."""

    @property
    def limits(self) -> Limits:
        """The rates that may be commanded."""
        ...

    @property
    def objective(self) -> Objective:
        """The cost to minimise."""
        ...

    def decide(
        self,
        physics: PhysicsModel,
        state: FloatArray,
        previous: WellRates,
        *,
        now: float = 0.0,
        plant: PlantKnowledge = NOTHING_LEARNT,
    ) -> Decision:
        """Return the rates to command from a `state` (nz, nx) on.

        Args:
            physics: the physics-based model, for one interval.
            state: the state estimate (nz, nx) [-].
            previous: the rates of the setpoint in force.
            now: the time of the state since the start of the experiment [s].
            plant: knowledge of pumps, person and physics.

        Raises:
            ModelUnavailable: the models do not answer.
        """
        ...

    def take_back(self) -> None:
        """Forget the last decision, because the asset did not take it."""
        ...


@dataclass(frozen=True)
class Controller:
    """The paper's controller: constant rates over a horizon.

    It minimises an objective of the predicted state over the rates within the limits.

    Attributes:
        limits: the rates that may be commanded.
        objective: the cost of a predicted state.
        horizon: how far ahead the state is predicted [s].
        evaluations: most predictions of one decision.
        patience: longest wall-clock time [s]; then the best rates so far are taken.
        search: the local optimiser.
        pauses: announced pauses and levels, since the start of the experiment; their mean over the
            horizon counts.
    """

    limits: Limits
    objective: Objective
    horizon: float
    evaluations: int
    patience: float = math.inf
    search: Search = cobyla.search
    pauses: FixedPauses = NO_PAUSES

    def take_back(self) -> None:
        """Do nothing: no decision depends on the one before."""

    def decide(
        self,
        physics: PhysicsModel,
        state: FloatArray,
        previous: WellRates,
        *,
        now: float = 0.0,
        plant: PlantKnowledge = NOTHING_LEARNT,
    ) -> Decision:
        """Return the rates of least cost, from `state` (nz, nx) and the `previous` rates.

        `plant` does not matter: the paper does not know it.

        Raises:
            ModelUnavailable: the physics-based model does not answer.
        """
        del plant

        def cost(rates: WellRates) -> float:
            water = self.objective.water_cost * float(self.limits.control_rates(rates).sum())
            announced = self.pauses.in_plan([RateStep(0.0, rates)], now, self.horizon)
            mean = mean_rates(plan_periods(announced, now, self.horizon))
            return self.objective(physics.predict(state, mean, self.horizon)) + water

        return optimise(
            self.limits,
            cost,
            previous,
            evaluations=self.evaluations,
            patience=self.patience,
            search=self.search,
        )


@dataclass(frozen=True)
class WithSubstitute:
    """A planner, and another one that decides where the model of the first does not answer."""

    planner: Planner
    substitute: Planner

    @property
    def limits(self) -> Limits:
        """The rates that may be commanded."""
        return self.planner.limits

    @property
    def objective(self) -> Objective:
        """The cost to minimise."""
        return self.planner.objective

    def decide(
        self,
        physics: PhysicsModel,
        state: FloatArray,
        previous: WellRates,
        *,
        now: float = 0.0,
        plant: PlantKnowledge = NOTHING_LEARNT,
    ) -> Decision:
        """Return the rates to command, with a remark where the substitute chose them.

        The arguments are as in `Planner`.

        Raises:
            ModelUnavailable: neither model answers.
        """
        try:
            return self.planner.decide(physics, state, previous, now=now, plant=plant)
        except ModelUnavailable as error:
            found = self.substitute.decide(physics, state, previous, now=now, plant=plant)
            return replace(found, remark=f'constant rates instead of a plan: {error}')

    def take_back(self) -> None:
        """Forget the last decision of both planners, because the asset did not take it."""
        self.planner.take_back()
        self.substitute.take_back()
