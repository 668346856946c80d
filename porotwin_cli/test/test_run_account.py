"""Figures of a closed-loop run."""

import pytest

from porotwin_cli.recorded.run_account import RunAccount
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate


@pytest.mark.parametrize(
    ('control1', 'orders'),
    [
        ([0.0, 0.0, 0.0], 0),
        ([500.0, 500.0, 500.0], 1),
        ([0.0, 120.0, 0.0], 2),
        ([0.0, 0.01], 0),  # no pump can be set so finely
        ([], 0),
    ],
)
def test_setpoints_with_other_rates_than_before_are_orders(
    control1: list[float], orders: int
) -> None:
    safe = {'injector': WellRate(from_ml_h(500.0), 1.0), 'control1': WellRate()}
    rates = [{**safe, 'control1': WellRate(from_ml_h(rate))} for rate in control1]
    assert RunAccount(rates=rates).orders(safe) == orders
