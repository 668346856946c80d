"""Tests of delivered rates."""

import pytest

from porotwin_core.rates.delivered_rates import delivered
from porotwin_core.rates.wells import WellRate, net_rate

RATES = {'in': WellRate(1e-7, 1.0), 'water': WellRate(1e-7), 'out': WellRate(-2e-7)}


def test_factors_multiply_rates_and_keep_fluids() -> None:
    found = delivered(RATES, {'in': 0.9})
    assert found['in'] == WellRate(0.9e-7, 1.0)
    assert found['out'] == RATES['out']


def test_the_producer_of_a_closed_rig_balances_what_is_delivered() -> None:
    found = delivered(RATES, {'in': 0.9, 'out': 1.3}, closed=True)
    assert net_rate(found) == pytest.approx(0.0, abs=1e-20)
    assert found['in'].rate == pytest.approx(0.9e-7)
    assert found['out'].rate == pytest.approx(-1.9e-7)


def test_nothing_flows_into_a_closed_rig_that_nothing_leaves() -> None:
    found = delivered({'in': WellRate(1e-7, 1.0)}, {}, closed=True)
    assert found['in'] == WellRate(0.0, 1.0)
