"""Maps whose tracer drifts away from the injected tracer are told, but not tracer that leaves."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.measures.mass_drift import drift_remark

RIG = box_rig(**{'in': (0.3, 0.2), 'out': (0.55, 0.2)})
"""1920 ml of pores."""
TIMES = [100.0 * number for number in range(1, 11)]
INJECTED = [0.4 * min(number, 5) / 5 for number in range(1, 11)]
"""Share of a middle block of a quarter of the rig: 38 ml more in each map, 192 ml at the end."""
PUMPED = Schedule(
    (
        ScheduleRow(0.0, 'in', WellRate(0.384e-6, 1.0)),
        ScheduleRow(0.0, 'out', WellRate(-0.384e-6)),
        ScheduleRow(500.0, 'in', WellRate(0.0)),
        ScheduleRow(500.0, 'out', WellRate(0.0)),
    )
)


def told(factors: list[float], *, at_exit: float = 0.0, background: float = 0.0) -> str:
    """Return the remark on maps with `factors` of the injected tracer in the middle of the rig."""
    maps = []
    for level, factor in zip(INJECTED, factors, strict=True):
        values = np.full((40, 60), background)
        values[10:30, 15:45] += level * factor
        values[18:22, 53:57] += at_exit
        maps.append(values)
    return drift_remark(maps, TIMES, RIG, PUMPED)


@pytest.mark.parametrize('factor', [0.9, 1.0, 1.1])
def test_tracer_that_keeps_to_the_pumps_is_not_told(factor: float) -> None:
    assert told([factor] * 10) == ''
    assert told([factor] * 10, background=0.01) == ''


def test_a_gain_and_a_loss_are_told_with_their_times() -> None:
    gain = told([1.0] * 5 + [1.0, 1.05, 1.1, 1.2, 1.3])
    assert 'to 1000 s the maps gain 57.6 ml of tracer more than the pumps injected' in gain
    loss = told([1.0] * 5 + [1.0, 0.95, 0.9, 0.8, 0.7])
    assert 'to 1000 s the maps lose 57.6 ml of the injected tracer' in loss


def test_tracer_near_a_producer_may_leave() -> None:
    assert told([1.0] * 5 + [1.0, 0.95, 0.9, 0.8, 0.7], at_exit=0.2) == ''


def test_one_wrong_photograph_is_no_drift() -> None:
    assert told([1.0] * 6 + [1.5] + [1.0] * 3) == ''


def test_hidden_parts_and_few_maps_are_not_judged() -> None:
    hidden = [np.full((40, 60), np.nan)] * 10
    assert drift_remark(hidden, TIMES, RIG, PUMPED) == ''
    assert drift_remark([], [], RIG, PUMPED) == ''
