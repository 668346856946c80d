"""The best schedule found offline."""

from dataclasses import replace

import numpy as np

from lab.loop.bench_loop_dose import Plan, ScenarioDose
from lab.loop.bench_loop_optimum import improved, photographs_until_set
from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.loop_operator import REFUSAL_PHOTOGRAPHS, Operator
from porotwin_hub.control.setpoint_limits import Limits


def test_a_plan_is_improved_within_the_limits() -> None:
    dose = ScenarioDose(replace(demo_scenario(), start=2400.0, end=3600.0), cell=0.02)
    begin = Plan(np.zeros(1), np.full((1, 3), dose.limits.max_rate / 3.0))
    better = improved(dose, begin, piece=600.0)
    assert dose.dose(better) < 0.9 * dose.dose(begin)
    assert better.rates.sum(axis=1).max() <= dose.limits.max_total_rate * (1.0 + 1e-9)
    assert better.rates.min() >= 0.0


def test_the_first_order_waits_for_the_person() -> None:
    limits = Limits.of(demo_scenario().rig)
    assert photographs_until_set(Operator(), limits, seed=1) == 0
    assert photographs_until_set(Operator(late=3), limits, seed=1) == 3
    unwilling = {photographs_until_set(Operator(refuses=0.3), limits, seed=n) for n in range(30)}
    assert min(unwilling) == 0
    assert max(unwilling) % REFUSAL_PHOTOGRAPHS == 0 < max(unwilling)
