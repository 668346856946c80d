"""The best schedule found offline."""

from dataclasses import replace

import numpy as np

from porotwin_cli.bench_loop_dose import Plan, ScenarioDose
from porotwin_cli.bench_loop_optimum import improved
from porotwin_cli.bench_loop_scenarios import demo_scenario


def test_a_plan_is_improved_within_the_limits() -> None:
    dose = ScenarioDose(replace(demo_scenario(), start=2400.0, end=3600.0), cell=0.02)
    begin = Plan(np.zeros(1), np.full((1, 3), dose.limits.max_rate / 3.0))
    better = improved(dose, begin, piece=600.0)
    assert dose.dose(better) < 0.9 * dose.dose(begin)
    assert better.rates.sum(axis=1).max() <= dose.limits.max_total_rate * (1.0 + 1e-9)
    assert better.rates.min() >= 0.0
