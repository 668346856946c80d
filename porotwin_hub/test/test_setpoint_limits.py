"""Tests of the limits: every setpoint keeps them, every violation is named."""

import dataclasses
import math

import numpy as np
import pytest
from hub_examples import LIMITS
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import WellRate, net_rate
from porotwin_core.rig import Rig
from porotwin_hub.control.setpoint_limits import Limits

ANYTHING = st.lists(
    st.one_of(st.floats(-1.0, 1.0), st.sampled_from([math.nan, math.inf, -math.inf, 1e300])),
    min_size=3,
    max_size=3,
)

ANYTHING_ML_H = st.lists(st.floats(0.0, 600.0), min_size=3, max_size=3)


@given(proposed=ANYTHING)
def test_no_proposal_breaks_a_limit(proposed: list[float]) -> None:
    rates = LIMITS.setpoint(np.array(proposed))
    assert LIMITS.violations(rates) == []
    assert set(rates) == set(LIMITS.all_wells)
    assert rates['injector'] == LIMITS.fixed['injector']


@given(proposed=st.lists(st.floats(0, 160.0), min_size=3, max_size=3))
def test_a_proposal_within_the_limits_is_kept_to_the_pumps_step(proposed: list[float]) -> None:
    rates = LIMITS.setpoint(from_ml_h(1.0) * np.array(proposed))
    for name, rate in zip(LIMITS.wells, proposed, strict=True):
        assert -1e-9 <= rate - to_ml_h(rates[name].rate) < 0.1 + 1e-6


@given(proposed=ANYTHING)
def test_the_setpoint_of_a_setpoint_is_the_same(proposed: list[float]) -> None:
    rates = LIMITS.setpoint(np.array(proposed))
    assert LIMITS.setpoint(LIMITS.control_rates(rates)) == rates


HAND_SET = dataclasses.replace(
    LIMITS, step=from_ml_h(5.0), min_rate=from_ml_h(20.0), max_change=from_ml_h(101.0)
)


@given(proposals=st.lists(ANYTHING_ML_H, min_size=1, max_size=6))
def test_pump_steps_least_rates_and_ramps_hold_along_any_proposals(
    proposals: list[list[float]],
) -> None:
    previous = HAND_SET.safe()
    for proposed in proposals:
        rates = HAND_SET.setpoint(from_ml_h(1.0) * np.array(proposed), previous)
        assert HAND_SET.violations(rates, previous) == []
        previous = rates


def test_a_rate_moves_towards_a_far_one_by_whole_steps() -> None:
    wanted = from_ml_h(1.0) * np.array([400.0, 0.0, 13.0])
    first = HAND_SET.setpoint(wanted, HAND_SET.safe())
    assert to_ml_h(1.0) * HAND_SET.control_rates(first) == pytest.approx([100.0, 0.0, 20.0])
    second = HAND_SET.setpoint(wanted, first)
    assert to_ml_h(second['control1'].rate) == pytest.approx(200.0)


def test_the_safe_rates_are_allowed_after_any_others() -> None:
    far = {**HAND_SET.safe(), 'control1': WellRate(from_ml_h(500.0))}
    assert HAND_SET.violations(HAND_SET.safe(), far) == []


def test_safe_rates_keep_the_injector_on_and_balance_it() -> None:
    safe = LIMITS.safe()
    assert to_ml_h(safe['producer'].rate) == pytest.approx(-500.0)
    assert net_rate(safe) == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'control1': WellRate(from_ml_h(501.0))}, "'control1': 501.0"),
        ({'control2': WellRate(from_ml_h(-1.0))}, "'control2': -1.0"),
        ({'control2': WellRate(from_ml_h(7.05))}, "'control2': 7.05 ml/h is no multiple of 0.1"),
        ({'control1': WellRate(from_ml_h(300)), 'control2': WellRate(from_ml_h(300))}, '600.0'),
        (
            {'injector': WellRate(from_ml_h(400.0), 1.0)},
            "'injector': 400.0 ml/h, but it must stay at 500.0",
        ),
        ({'producer': WellRate(from_ml_h(-499.0))}, '1 ml/h more is injected than produced'),
        ({'producer': WellRate(from_ml_h(-501.0))}, '1 ml/h more is produced than injected'),
        ({'producer': WellRate(from_ml_h(50.0))}, "'producer': 50.0 ml/h, but the producer never"),
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


def test_the_concentration_of_a_well_that_does_not_inject_breaks_no_limit() -> None:
    rates = LIMITS.safe()
    rates |= {'control1': WellRate(0.0, 1.0), 'producer': WellRate(rates['producer'].rate, 1.0)}
    assert LIMITS.violations(rates) == []


def test_the_producer_takes_out_no_more_than_it_may(small_rig: Rig) -> None:
    assert small_rig.control is not None
    control = small_rig.control.model_copy(update={'max_producer_rate_ml_h': 600.0})
    limits = Limits.of(small_rig.model_copy(update={'control': control}))
    found = limits.setpoint(np.full(len(limits.wells), limits.max_rate))
    assert to_ml_h(found['producer'].rate) == pytest.approx(-600.0, abs=0.5)
    assert limits.violations(found) == []
    together = limits.violations({**found, 'control1': WellRate(limits.max_rate)})
    assert any('which max_producer_rate_ml_h 600 leaves' in line for line in together)
    more = {**found, 'producer': WellRate(from_ml_h(-601.0))}
    assert any('takes out at most 600 ml/h' in line for line in limits.violations(more))
