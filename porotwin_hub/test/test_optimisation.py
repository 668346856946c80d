"""Tests of the optimisation: the best point within the limits, and an exchangeable search."""

import math
import time
from collections.abc import Callable

import numpy as np
from hub_examples import LIMITS, quadratic
from hypothesis import given, settings
from hypothesis import strategies as st

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.optimisation import optimise
from porotwin_hub.control.setpoint_limits import Limits


def test_the_best_point_counts_when_the_time_is_over() -> None:
    calls = 0

    def slow(rates: WellRates) -> float:
        nonlocal calls
        calls += 1
        time.sleep(0.02)
        return quadratic((120.0, 40.0, 210.0))(rates)

    decision = optimise(LIMITS, slow, LIMITS.safe(), evaluations=500, patience=0.2)
    assert decision.evaluations == calls <= 12
    assert decision.cost < decision.cost_unchanged
    at_once = optimise(LIMITS, slow, LIMITS.safe(), evaluations=500, patience=0.0)
    assert (at_once.evaluations, at_once.rates) == (1, LIMITS.safe())


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_the_decision_is_the_best_point_seen_and_never_worse_than_no_change(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen: list[float] = []

    def rough(rates: WellRates) -> float:
        seen.append(float(rng.random()))
        return seen[-1]

    decision = optimise(LIMITS, rough, LIMITS.safe(), evaluations=20)
    assert decision.cost == min(seen)
    assert decision.cost <= decision.cost_unchanged
    assert LIMITS.violations(decision.rates) == []


def test_another_search_takes_the_place_of_cobyla() -> None:
    best = (130.0, 0.0, 0.0)

    def to_the_minimum(
        cost: Callable[[FloatArray], float],
        start: FloatArray,
        *,
        limits: Limits,
        typical_cost: float,
        evaluations: int,
    ) -> None:
        assert typical_cost > 0.0
        assert evaluations > 0
        cost(from_ml_h(1.0) * np.array(best))

    decision = optimise(
        LIMITS, quadratic(best), LIMITS.safe(), evaluations=20, search=to_the_minimum
    )
    found = to_ml_h(1.0) * LIMITS.control_rates(decision.rates)
    np.testing.assert_allclose(found, best, atol=0.11)
    assert math.isclose(decision.cost, 0.0, abs_tol=0.02)
