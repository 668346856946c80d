"""The cost of a plan that some siblings expect on average, or the worst of them, and its gradient.

A plan that is good for the mean alone may be poor for half of the siblings; the mean of their costs
counts their doubt (robust optimisation; van Essen et al., SPE Journal 14 (2009) 202-210).
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import EffectDescription, Rig
from porotwin_siblings.unknowns import Sibling
from porotwin_solver.adjoint.schedule_cost import ScheduleCost, schedule_cost
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import physics_on_top
from porotwin_solver.model.model import Model


@dataclass(frozen=True)
class CostOrder:
    """A request for the judgement of a sibling.

    Attributes:
        rig: the rig as described.
        grid: grid of `initial` and of the terms.
        sibling: who judges.
        usual: believed rate over commanded rate by well [-], which the plan counts already.
        initial: concentration at the start of the plan, (nz, nx) [-].
        plan: the rates; its times count from the initial state.
        horizon: how long [s].
        terms: of the cost.
        with_gradient: whether the gradient is wanted.
    """

    rig: Rig
    grid: Grid
    sibling: Sibling
    usual: Mapping[str, float]
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
    model = Model(
        order.rig,
        order.grid,
        preset='fast',
        effects=order.sibling.diagnosed,
        adapt=partial(_beside_the_usual, order.sibling.changes, order.usual),
    )
    return schedule_cost(
        model,
        order.initial,
        order.plan,
        horizon=order.horizon,
        terms=order.terms,
        with_gradient=order.with_gradient,
    )


def _beside_the_usual(
    changes: Sequence[EffectDescription], usual: Mapping[str, float], physics: Physics
) -> Physics:
    """Return `physics` with `changes` on top, and pumps relative to the `usual` ones."""
    changed = physics_on_top(physics, changes)
    factors = {well: factor / usual.get(well, 1.0) for well, factor in changed.rate_factors.items()}
    return replace(changed, rate_factors=factors)


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
