"""Maps with more tracer than the pumps injected are named."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_core.checks.mass_check import excess_remark
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate

RIG = box_rig(**{'in': (0.1, 0.1)})
"""1920 ml of pores."""

INJECTED = Schedule((ScheduleRow(100.0, 'in', WellRate(1e-6, 0.5)),))
"""Half stock, 1 ml/s from 100 s on."""


@pytest.mark.parametrize(
    ('share', 'time', 'wrong'),
    [
        (0.05, 292.0, False),  # 96 ml are seen, 96 ml were injected
        (0.02, 292.0, False),  # tracer may have left
        (0.10, 292.0, True),
        (0.005, 100.0, False),  # the noise of clean sand before the injection
        (0.05, 50.0, True),  # tracer before the injection
    ],
)
def test_only_too_much_tracer_is_named(share: float, time: float, wrong: bool) -> None:
    values = np.full((20, 30), share)
    assert bool(excess_remark(values, time, RIG, INJECTED)) is wrong


def test_the_remark_names_both_volumes_and_unknown_cells_hold_nothing() -> None:
    values = np.full((20, 30), np.nan)
    values[:10] = 0.4
    assert '384 ml of tracer stock, but the pumps injected 96 ml' in excess_remark(
        values, 292.0, RIG, INJECTED
    )


def test_unknown_rates_contradict_nothing() -> None:
    assert excess_remark(np.ones((20, 30)), 0.0, RIG, Schedule(())) == ''
