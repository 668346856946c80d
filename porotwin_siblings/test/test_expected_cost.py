"""The cost that some siblings expect on average, and its gradient."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from siblings_examples import EMPTY, GRID, RATES, RIG

from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_siblings.expected_cost import CostOrder, chosen_judges, expected_cost, judge_plan
from porotwin_siblings.unknowns import Sibling
from porotwin_solver.effects.dispersion import EFFECT as DISPERSION
from porotwin_solver.effects.rate import EFFECT as RATE

SPREAD = DISPERSION.described(longitudinal_dispersivity=1e-3, transverse_dispersivity=1e-4)
HORIZON = 1800.0
WEIGHTS = np.zeros(GRID.shape)
WEIGHTS[8:] = RIG.cell_pore_volume(GRID)[8:]
PLUME = EMPTY.copy()
PLUME[4:9, 4:10] = 0.8


def order(factor: float, control: float = RATES['control1'].rate) -> CostOrder:
    """Return the order of a sibling whose control well delivers `factor` of its rate [m^3/s]."""
    rates = {**RATES, 'control1': WellRate(control)}
    return CostOrder(
        RIG,
        GRID,
        Sibling((SPREAD, RATE.described(well='control1', factor=factor)), photograph_error=0.0),
        {},
        PLUME,
        (RateStep(0.0, rates),),
        HORIZON,
        (CostTerm(0.0, HORIZON, linear=WEIGHTS),),
        True,
    )


@pytest.fixture(scope='module')
def pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(2)


def test_the_expected_cost_is_the_mean_of_those_of_the_siblings(pool: ThreadPoolExecutor) -> None:
    orders = [order(0.7), order(1.1)]
    found, alone = expected_cost(orders, pool), [judge_plan(one) for one in orders]
    assert found.cost == pytest.approx(np.mean([one.cost for one in alone]))
    np.testing.assert_allclose(found.gradient, np.mean([one.gradient for one in alone], axis=0))
    assert alone[0].cost != alone[1].cost


def test_a_cautious_plan_counts_the_worst_siblings_only(pool: ThreadPoolExecutor) -> None:
    orders = [order(factor) for factor in (0.7, 0.9, 1.1, 1.3)]
    alone = sorted((judge_plan(one) for one in orders), key=lambda one: -one.cost)
    found = expected_cost(orders, pool, worst_share=0.5)
    assert found.cost == pytest.approx(np.mean([one.cost for one in alone[:2]]))
    np.testing.assert_allclose(found.gradient, np.mean([one.gradient for one in alone[:2]], axis=0))
    assert expected_cost(orders, pool, worst_share=0.01).cost == alone[0].cost


def test_the_gradient_is_by_the_rate_that_is_asked_for_not_by_the_delivered_one() -> None:
    rate = RATES['control1'].rate
    step = 1e-3 * rate
    high, low = (judge_plan(order(0.7, rate + sign * step)).cost for sign in (1.0, -1.0))
    found = judge_plan(order(0.7))
    place = list(RIG.wells).index('control1')
    assert found.gradient is not None
    assert found.gradient[0, place] == pytest.approx((high - low) / (2 * step), rel=0.02)


def test_without_a_gradient_the_cost_is_the_same(pool: ThreadPoolExecutor) -> None:
    plain = expected_cost([replace(order(0.7), with_gradient=False)], pool)
    assert plain.gradient is None
    assert plain.cost == pytest.approx(judge_plan(order(0.7)).cost)


def test_judges_stand_for_equal_shares_of_all() -> None:
    assert chosen_judges(range(32), 4) == [4, 12, 20, 28]
    assert chosen_judges([5, 3], 4) == [5, 3]
