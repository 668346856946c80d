"""The dose of plans with all secrets known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lab.loop.bench_loop_dose import Plan, ScenarioDose, simple_plans
from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.loop_scenario import LoopScenario, PumpFault

CELL_M = 0.04


def late(**changes: Any) -> LoopScenario:
    """Return the demo's last minutes."""
    return replace(demo_scenario(), start=2700.0, end=3900.0, **changes)


def held(dose: ScenarioDose, well: int) -> Plan:
    rates = np.zeros((1, len(dose.limits.wells)))
    rates[0, well] = dose.limits.max_rate
    return Plan(np.zeros(1), rates)


def test_a_dead_injector_gives_no_dose() -> None:
    dose = ScenarioDose(late(faults=(PumpFault('injector', 0.0),)), cell=CELL_M)
    assert dose.dose(held(dose, 0)) == 0.0


def test_an_injector_that_stood_still_before_the_takeover_leaves_less_tracer() -> None:
    nothing = Plan(np.zeros(1), np.zeros((1, 3)))
    paused = ScenarioDose(late(faults=(PumpFault('injector', 0.0, 600.0, 1200.0),)), cell=CELL_M)
    assert paused.dose(nothing) < 0.9 * ScenarioDose(late(), cell=CELL_M).dose(nothing)


def test_derivatives_know_the_faults() -> None:
    dose = ScenarioDose(late(faults=(PumpFault('control2', 0.5, 3000.0),)), cell=CELL_M)
    rate = 0.4 * dose.limits.max_rate
    plan = Plan(np.array([0.0, 480.0]), np.full((2, 3), 0.5 * rate))
    _, slope = dose.cost(plan)
    step = np.zeros((2, 3))
    step[0, 1] = 0.01 * rate
    high, low = (dose.cost(plan._replace(rates=plan.rates + s))[0] for s in (step, -step))
    assert slope[0, 1] == pytest.approx((high - low) / (2.0 * step[0, 1]), rel=0.05)


def test_simple_plans_keep_the_limits_and_begin_with_no_water() -> None:
    limits = ScenarioDose(late(), cell=CELL_M).limits
    constant, switched = simple_plans(limits, 1200.0, [0.5])
    assert not constant[0].rates.any()
    assert len(constant) == 8
    assert len(switched) == 12
    for plan in constant + switched:
        assert plan.rates.sum(axis=1).max() <= limits.max_total_rate * (1.0 + 1e-9)
