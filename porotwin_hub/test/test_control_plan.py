"""Tests of plans of the control wells: blocks, stages, orders, ramps."""

import dataclasses

import numpy as np
import pytest
from hub_examples import LIMITS

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.order_delay import LEAST_DELAY_S
from porotwin_hub.control.control_plan import ControlPlan, growing_blocks

ML_H = from_ml_h(1.0)
ONE, TWO, NONE = (np.array(rates) * ML_H for rates in ([500.0, 0, 0], [0, 0, 500.0], [0.0, 0, 0]))
PLAN = ControlPlan(np.array([0.0, 600.0, 1200.0]), np.array([ONE, ONE, TWO]), 3000.0)


@pytest.mark.parametrize('horizon', [25.0, 60.0, 1800.0, 4800.0, 86400.0])
def test_blocks_grow_and_none_is_short(horizon: float) -> None:
    starts = growing_blocks(horizon)
    lengths = np.diff(np.append(starts, horizon))
    assert starts[0] == 0.0
    assert len(starts) < 30
    assert (lengths > min(LEAST_DELAY_S, horizon) * 0.99).all()


def test_moments_of_a_plan_are_among_the_blocks() -> None:
    starts = growing_blocks(3000.0, (0.0, 55.0, 1234.0))
    assert {0.0, 55.0, 1234.0} <= set(starts)
    assert np.diff(starts).min() > LEAST_DELAY_S


def test_stages_join_blocks_with_the_same_rates() -> None:
    stages = PLAN.stages()
    np.testing.assert_array_equal(stages.starts, [0.0, 1200.0])
    assert stages.orders(ONE) == 1
    assert stages.orders(NONE) == 2


def test_what_is_left_of_a_plan_keeps_its_moments() -> None:
    left = PLAN.after(630.0, 2370.0)
    np.testing.assert_allclose(left.starts, [0.0, 570.0])
    np.testing.assert_array_equal(left.rates, [ONE, TWO])
    due = PLAN.after(1190.0, 1810.0)  # the change is due before the next photograph
    np.testing.assert_array_equal(due.rates, [TWO])


def test_the_rates_of_a_block_are_those_at_its_beginning() -> None:
    blocks = PLAN.on_blocks(np.array([0.0, 700.0, 1200.0, 2000.0]))
    np.testing.assert_array_equal(blocks.rates, [ONE, ONE, TWO, TWO])


def test_a_far_change_is_made_step_by_step_where_rates_may_not_jump() -> None:
    slow = dataclasses.replace(LIMITS, max_change=from_ml_h(200.0))
    plan = PLAN.executable(slow, slow.safe(), 30.0)
    first = to_ml_h(1.0) * plan.rates[:, 0]
    np.testing.assert_allclose(plan.starts[:3], [0.0, 30.0, 60.0])
    np.testing.assert_allclose(first[:3], [200.0, 400.0, 500.0])
    at_once = PLAN.executable(LIMITS, LIMITS.safe(), 30.0)
    np.testing.assert_array_equal(at_once.starts, PLAN.starts)


def test_an_order_is_taken_back_by_joining_two_stages() -> None:
    stages = PLAN.stages()
    kept = stages.without_change(0, NONE)
    np.testing.assert_array_equal(kept.rates, [NONE, TWO])
    joined = stages.without_change(1, NONE)
    np.testing.assert_allclose(joined.rates, [0.4 * ONE + 0.6 * TWO])
    held = stages.without_change(1, ONE)  # nothing was ordered before, nothing is now
    np.testing.assert_array_equal(held.rates, [ONE])


def test_the_change_that_moves_least_water_is_the_easiest() -> None:
    small = ControlPlan(np.array([0.0, 600.0]), np.array([0.9 * ONE, ONE]), 1200.0)
    assert small.easiest_changes(NONE) == [1, 0]
    assert PLAN.stages().easiest_changes(ONE) == [1]
