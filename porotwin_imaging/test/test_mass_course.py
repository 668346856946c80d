"""A map from another time is named, and nothing that pumps can do is."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.measures.mass_course import jump_remark, jumps

RIG = box_rig(**{'in': (0.1, 0.1)})
"""1920 ml of pores."""
TIMES = [100.0 * number for number in range(1, 9)]
STEADY = [0.05 * number for number in range(1, 9)]
"""Mean concentrations: 96 ml more in each map, and just so much is injected."""
NAMES = [f'{number}.jpg' for number in range(1, 9)]
PUMPED = Schedule((ScheduleRow(0.0, 'in', WellRate(0.96e-6, 1.0)),))


def maps(levels: list[float]) -> list[np.ndarray]:
    return [np.full((20, 30), level) for level in levels]


def swapped(first: int, second: int) -> list[float]:
    levels = list(STEADY)
    levels[first], levels[second] = levels[second], levels[first]
    return levels


def found(levels: list[float], schedule: Schedule = PUMPED) -> list[int]:
    return [one.number for one in jumps(maps(levels), TIMES, RIG, schedule)]


def test_both_swapped_photographs_are_named_with_their_neighbours() -> None:
    assert found(STEADY) == []
    assert found(swapped(1, 6)) == [1, 6]
    remark = jump_remark(maps(swapped(1, 6)), TIMES, NAMES, RIG, PUMPED)
    assert (
        '2.jpg shows 672 ml of tracer stock, the maps before and after it 96 and 288 ml' in remark
    )
    assert '7.jpg shows 192 ml' in remark
    assert 'were files swapped' in remark
    assert '\n' not in remark


@pytest.mark.parametrize('last', [0.05, 0.35])
def test_what_pumps_can_do_is_no_jump(last: float) -> None:
    """Water, or a producer, moves a plume out of the rig as fast as it came."""
    rows = (
        ScheduleRow(0.0, 'in', WellRate(0.96e-6, 1.0)),
        ScheduleRow(400.0, 'in', WellRate(-0.96e-6, 0.0)),
    )
    assert found([0.05, 0.1, 0.15, 0.2, 0.15, 0.1, 0.05, last], Schedule(rows)) == []


def test_sand_that_one_map_hides_is_no_jump() -> None:
    hidden = maps(STEADY)
    hidden[4] = hidden[4].copy()
    hidden[4][:, :20] = np.nan
    assert jumps(hidden, TIMES, RIG, PUMPED) == []


@pytest.mark.parametrize('count', [1, 2])
def test_few_maps_or_unknown_rates_tell_nothing(count: int) -> None:
    assert jumps(maps(STEADY)[:count], TIMES[:count], RIG, PUMPED) == []
    assert jump_remark(maps(swapped(1, 6)), TIMES, NAMES, RIG, Schedule(())) == ''
