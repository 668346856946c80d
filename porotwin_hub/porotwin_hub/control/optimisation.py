"""Choosing the rates of the control wells: the best of several starts and a local search.

The search is exchangeable: any `Search` will do, `cobyla.search` is the default.
"""

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import RateStep, WellRate, WellRates
from porotwin_hub.control import cobyla
from porotwin_hub.control.setpoint_limits import Limits

CostFn = Callable[[WellRates], float]
"""The cost of pumping some rates; raises an error if no model can tell."""


class Search(Protocol):
    """A local optimiser of the control rates."""

    def __call__(
        self,
        cost: Callable[[FloatArray], float],
        start: FloatArray,
        *,
        limits: Limits,
        typical_cost: float,
        evaluations: int,
    ) -> None:
        """Evaluate `cost` where it may be low; the caller keeps the best point.

        Args:
            cost: of control rates (wells,) [m^3/s]; points outside the limits are moved into them.
            start: the best point so far, (wells,) [m^3/s].
            limits: of the rates.
            typical_cost: a positive cost, to scale with.
            evaluations: most evaluations allowed.
        """
        ...


@dataclass(frozen=True)
class Decision:
    """The result of an optimisation.

    `rates` [m^3/s] are the chosen ones of all wells, `cost` is theirs and `cost_unchanged` that of
    the unchanged rates, in the unit of the cost function. `evaluations` counts evaluated points.
    `plan` holds the rates of all wells from the state on; without one, `rates` stay. `remark` tells
    people about a fault.
    """

    rates: dict[str, WellRate]
    cost: float
    cost_unchanged: float
    evaluations: int
    plan: tuple[RateStep, ...] = ()
    remark: str = ''


class OutOfTimeError(Exception):
    """The time for an optimisation is over."""


class EvaluatedSetpoints:
    """The costs of all setpoints evaluated so far; calls a costly function once per setpoint."""

    def __init__(
        self, limits: Limits, cost: CostFn, previous: WellRates, *, patience: float
    ) -> None:
        """Evaluate `cost` within `limits`, for at most `patience` [s of wall-clock time].

        `previous` are the rates of the setpoint in force.
        """
        self._limits = limits
        self._previous = previous
        self._cost = cost
        self._deadline = time.monotonic() + patience
        self._costs: dict[tuple[float, ...], float] = {}

    def __len__(self) -> int:
        """Return the number of setpoints evaluated."""
        return len(self._costs)

    def __call__(self, control_rates: FloatArray) -> float:
        """Return the cost of the setpoint nearest to `control_rates` (wells,) [m^3/s].

        Raises:
            OutOfTimeError: the setpoint is new and the time is over; the first is always evaluated.
        """
        rates = self._limits.setpoint(control_rates, self._previous)
        key = tuple(self._limits.control_rates(rates))
        if key not in self._costs:
            if self._costs and time.monotonic() > self._deadline:
                raise OutOfTimeError
            self._costs[key] = self._cost(rates)
        return self._costs[key]

    def best(self) -> tuple[dict[str, WellRate], float]:
        """Return the setpoint of least cost and its cost."""
        key = min(self._costs, key=lambda key: self._costs[key])
        return self._limits.setpoint(np.array(key), self._previous), self._costs[key]


def optimise(
    limits: Limits,
    cost: CostFn,
    previous: WellRates,
    *,
    evaluations: int,
    patience: float = math.inf,
    search: Search = cobyla.search,
) -> Decision:
    """Return the setpoint of least cost that was found within the limits.

    The cost has several valleys, so the starts are the previous rates, no control, and each control
    well alone at its maximum; `search` begins at the best of them. Every point that is evaluated is
    a setpoint within the limits, rounded as the pumps round it. The result is the best of all
    points, never worse than the previous rates.

    Args:
        limits: of the rates.
        cost: of pumping some rates.
        previous: the rates until now; they are always evaluated.
        evaluations: most calls of `cost` by the search and the starts together.
        patience: longest wall-clock time [s]; then the best point so far is taken.
        search: the local optimiser.
    """
    evaluated = EvaluatedSetpoints(limits, cost, previous, patience=patience)
    unchanged = limits.control_rates(previous)
    cost_unchanged = evaluated(unchanged)
    with contextlib.suppress(OutOfTimeError):
        starts = [
            unchanged,
            np.zeros(len(limits.wells)),
            *(np.eye(len(limits.wells)) * limits.max_rate),
        ]
        costs = [evaluated(start) for start in starts]
        remaining = evaluations - len(evaluated)
        if remaining > 0 and max(costs) > 0:
            search(
                evaluated,
                starts[int(np.argmin(costs))],
                limits=limits,
                typical_cost=max(costs),
                evaluations=remaining,
            )
    rates, least = evaluated.best()
    return Decision(rates, least, cost_unchanged, len(evaluated))
