"""The cost of a plan that some siblings expect on average, or the worst of them, and its gradient.

A plan that is good for the mean alone may be poor for half of the siblings; the mean of their costs
counts their doubt (robust optimisation; van Essen et al., SPE Journal 14 (2009) 202-210).
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.delivered_rates import delivered
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import Rig
from porotwin_siblings.course import with_traits
from porotwin_siblings.traits import Traits
from porotwin_solver.adjoint.schedule_cost import ScheduleCost, schedule_cost
from porotwin_solver.model.model import Model


@dataclass(frozen=True)
class CostOrder:
    """A request for the judgement of a sibling.

    Attributes:
        rig: the rig as described.
        grid: grid of `initial` and of the terms.
        traits: of the sibling.
        factors: delivered rate over the rate in the plan, by well [-].
        initial: concentration at the start of the plan, (nz, nx) [-].
        plan: the rates; its times count from the initial state.
        horizon: how long [s].
        terms: of the cost.
        with_gradient: whether the gradient is wanted.
    """

    rig: Rig
    grid: Grid
    traits: Traits
    factors: dict[str, float]
    initial: FloatArray
    plan: tuple[RateStep, ...]
    horizon: float
    terms: tuple[CostTerm, ...]
    with_gradient: bool


def chosen_judges(ranked: Sequence[int], count: int) -> list[int]:
    """Return `count` numbers of siblings that stand for equal shares of all.

    `ranked` are the numbers of all siblings in the order of the tracer that they expect.
    """
    count = min(count, len(ranked))
    return [ranked[(2 * n + 1) * len(ranked) // (2 * count)] for n in range(count)]


def judge_plan(order: CostOrder) -> ScheduleCost:
    """Return the cost that one sibling expects, and its gradient by the rates of the plan.

    Raises:
        InputError: as `schedule_cost`.
    """
    rig, factors = order.rig, order.factors
    model = Model(
        rig,
        order.grid,
        preset='fast',
        effects=order.traits.effects,
        adapt=partial(with_traits, order.traits),
    )
    plan = [
        RateStep(step.start, delivered(step.rates, factors, closed=rig.closed))
        for step in order.plan
    ]
    found = schedule_cost(
        model,
        order.initial,
        plan,
        horizon=order.horizon,
        terms=order.terms,
        with_gradient=order.with_gradient,
    )
    if found.gradient is None:
        return found
    shares = np.array([factors.get(well, 1.0) for well in rig.wells])
    return ScheduleCost(found.cost, found.gradient * shares)


def expected_cost(
    orders: Sequence[CostOrder], executor: Executor, *, worst_share: float = 1.0
) -> ScheduleCost:
    """Return the mean cost of `orders`, one for each sibling, and its gradient.

    A `worst_share` below 1 takes the mean over that share of the siblings with the highest costs
    only: a cautious plan (conditional value at risk; Rockafellar and Uryasev, J. Risk 2 (2000)
    21-41). It is what a quantile is meant for, and it has a gradient.

    Raises:
        InputError: as `schedule_cost`.
    """
    found = sorted(executor.map(judge_plan, orders), key=lambda one: -one.cost)
    worst = found[: max(1, round(worst_share * len(found)))]
    cost = float(np.mean([one.cost for one in worst]))
    gradients = [one.gradient for one in worst if one.gradient is not None]
    return ScheduleCost(cost, np.mean(gradients, axis=0) if gradients else None)
