"""Figures of a closed-loop run."""

import pytest

from porotwin_cli.recorded.run_account import RunAccount
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig


@pytest.mark.parametrize(
    ('control1', 'orders'),
    [
        ([0.0, 0.0, 0.0], 0),
        ([500.0, 500.0, 500.0], 1),
        ([0.0, 120.0, 0.0], 2),
        ([0.0, 0.01], 0),  # no hand sets a pump so finely
        ([], 0),
        ([0.6, 1.2, 1.8], 2),  # a start is one, however slow
    ],
)
def test_setpoints_that_a_hand_changes_are_orders(control1: list[float], orders: int) -> None:
    rig = load_rig(small_rig())
    rates = [{**safe_rates(rig), 'control1': WellRate(from_ml_h(rate))} for rate in control1]
    assert RunAccount(rates=rates).orders(rig) == orders
