"""The limits hold whatever is asked; the optimiser finds the best rates within them."""

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.units import from_ml_h, to_ml_h
from porotwin_core.wells import WellRate, WellRates, net_rate
from porotwin_hub.control import Limits, optimise

LIMITS = Limits(
    wells=('control1', 'control2', 'control3'),
    producer='producer',
    fixed={'injector': WellRate(from_ml_h(500.0), 1.0)},
    max_rate=from_ml_h(500.0),
    max_total_rate=from_ml_h(500.0),
    all_wells=('injector', 'producer', 'control1', 'control2', 'control3', 'idle'),
)
ANYTHING = st.lists(
    st.one_of(st.floats(-1.0, 1.0), st.sampled_from([math.nan, math.inf, -math.inf, 1e300])),
    min_size=3,
    max_size=3,
)


@given(wished=ANYTHING)
def test_no_wish_breaks_a_limit(wished: list[float]) -> None:
    rates = LIMITS.setpoint(np.array(wished))
    assert LIMITS.violations(rates) == []
    assert set(rates) == set(LIMITS.all_wells)
    assert rates['injector'] == LIMITS.fixed['injector']


@given(wished=st.lists(st.floats(0, 160.0), min_size=3, max_size=3))
def test_a_wish_within_the_limits_is_followed_to_the_pumps_step(wished: list[float]) -> None:
    rates = LIMITS.setpoint(from_ml_h(1.0) * np.array(wished))
    for name, wish in zip(LIMITS.wells, wished, strict=True):
        assert -1e-9 <= wish - to_ml_h(rates[name].rate) < 0.1 + 1e-6


@given(wished=ANYTHING)
def test_a_setpoint_is_its_own_setpoint(wished: list[float]) -> None:
    rates = LIMITS.setpoint(np.array(wished))
    assert LIMITS.setpoint(LIMITS.control_rates(rates)) == rates


def test_safe_rates_keep_the_tracer_running_and_balance_it() -> None:
    safe = LIMITS.safe()
    assert to_ml_h(safe['producer'].rate) == pytest.approx(-500.0)
    assert net_rate(safe) == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'control1': WellRate(from_ml_h(501.0))}, "'control1': 501.0"),
        ({'control2': WellRate(from_ml_h(-1.0))}, "'control2': -1.0"),
        ({'control1': WellRate(from_ml_h(300)), 'control2': WellRate(from_ml_h(300))}, '600.0'),
        ({'injector': WellRate(from_ml_h(400.0), 1.0)}, "'injector' must stay"),
        ({'producer': WellRate(from_ml_h(-499.0))}, 'net rate must be zero'),
        ({'ghost': WellRate(1e-9)}, "'ghost' is not in the rig"),
        (
            {'idle': WellRate(from_ml_h(1e6))},
            "'idle': 1000000.0 ml/h, but control gives it no role",
        ),
        (
            {'control1': WellRate(from_ml_h(9.0), 1.0)},
            "'control1' injects concentration 1, must be",
        ),
        ({'injector': WellRate(from_ml_h(500.0))}, "'injector' injects concentration 0, must be 1"),
    ],
)
def test_every_broken_limit_is_named(change: dict[str, WellRate], named: str) -> None:
    lines = LIMITS.violations({**LIMITS.safe(), **change})
    assert any(named in line for line in lines), lines


def test_what_a_well_that_pumps_nothing_or_produces_would_inject_does_not_matter() -> None:
    rates = LIMITS.safe()
    rates |= {'control1': WellRate(0.0, 1.0), 'producer': WellRate(rates['producer'].rate, 1.0)}
    assert LIMITS.violations(rates) == []


def quadratic(best_ml_h: tuple[float, float, float]) -> Callable[[WellRates], float]:
    def cost(rates: WellRates) -> float:
        values = to_ml_h(1.0) * LIMITS.control_rates(rates)
        return float(((values - np.array(best_ml_h)) ** 2).sum())

    return cost


@pytest.mark.parametrize('best', [(120.0, 40.0, 210.0), (0.0, 0.0, 0.0), (0.0, 480.0, 0.0)])
def test_the_optimiser_finds_the_valley_of_a_bowl(best: tuple[float, float, float]) -> None:
    decision = optimise(LIMITS, quadratic(best), LIMITS.safe(), evaluations=120)
    found = to_ml_h(1.0) * LIMITS.control_rates(decision.rates)
    np.testing.assert_allclose(found, best, atol=6.0)
    assert decision.evaluations <= 120


def test_the_optimiser_stops_at_the_total_limit() -> None:
    decision = optimise(LIMITS, quadratic((400.0, 400.0, 0.0)), LIMITS.safe(), evaluations=150)
    found = to_ml_h(1.0) * LIMITS.control_rates(decision.rates)
    np.testing.assert_allclose(found, (250.0, 250.0, 0.0), atol=10.0)


def test_out_of_time_the_best_point_so_far_is_taken() -> None:
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


@given(seed=st.integers(0, 10_000))
def test_the_decision_is_the_best_point_seen_and_never_worse_than_staying(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen: list[float] = []

    def rough(rates: WellRates) -> float:
        seen.append(float(rng.random()))
        return seen[-1]

    decision = optimise(LIMITS, rough, LIMITS.safe(), evaluations=20)
    assert decision.cost == min(seen)
    assert decision.cost <= decision.cost_unchanged
    assert LIMITS.violations(decision.rates) == []
