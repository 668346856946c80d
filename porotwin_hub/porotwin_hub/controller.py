"""The controller: chooses the rates of the control wells by predictions (paper, section 4)."""

import math
from dataclasses import dataclass

from porotwin_core.grid import FloatArray
from porotwin_core.wells import WellRates
from porotwin_hub import cobyla
from porotwin_hub.forecast import PhysicsModel
from porotwin_hub.objective import Objective
from porotwin_hub.optimisation import Decision, Search, optimise
from porotwin_hub.setpoint_limits import Limits


@dataclass(frozen=True)
class Controller:
    """Minimises an objective of the predicted state over the rates within the limits.

    Attributes:
        limits: the rates that may be commanded.
        objective: the cost of a predicted state.
        horizon: how far ahead the state is predicted [s].
        evaluations: most predictions of one decision.
        patience: longest wall-clock time [s]; then the best rates so far are taken.
        search: the local optimiser.
    """

    limits: Limits
    objective: Objective
    horizon: float
    evaluations: int
    patience: float = math.inf
    search: Search = cobyla.search

    def decide(self, physics: PhysicsModel, state: FloatArray, previous: WellRates) -> Decision:
        """Return the rates of least cost, from `state` (nz, nx) and the `previous` rates.

        Raises:
            ModelUnavailable: the physics-based model does not answer.
        """

        def cost(rates: WellRates) -> float:
            return self.objective(physics.predict(state, rates, self.horizon))

        return optimise(
            self.limits,
            cost,
            previous,
            evaluations=self.evaluations,
            patience=self.patience,
            search=self.search,
        )
