"""Figures of a closed-loop run."""

import pytest

from porotwin_cli.recorded.run_account import RunAccount
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig


@pytest.mark.parametrize(
    ('control1', 'orders'),
    [
        ([0.0, 0.0, 0.0], 0),
        ([500.0, 500.0, 500.0], 1),
        ([0.0, 120.0, 0.0], 2),
        ([], 0),
        ([0.6, 1.2, 1.8], 1),
    ],
)
def test_setpoints_that_a_hand_changes_are_orders(control1: list[float], orders: int) -> None:
    rates = {
        'injector': [500.0] * len(control1),
        'producer': [-500.0 - rate for rate in control1],
        'control1': control1,
    }
    assert RunAccount(rates_ml_h=rates).orders(load_rig(small_rig())) == orders
