"""Maps out of place in time are found, and no others."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.checks.course_of_maps import CHECK, jumps, misplaced_maps
from porotwin_checks.known import Known
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate

TIMES = [60.0 * number for number in range(20)]
X, Z = np.meshgrid(np.arange(60), np.arange(40))


def plume(noise=0.01, light=0.0, seed=1):
    """Return maps of a disc that grows with the injected volume."""
    generator = np.random.default_rng(seed)
    maps = []
    for number in range(len(TIMES)):
        radius = 4.0 * np.sqrt(number)
        disc = np.clip(radius - np.hypot(X - 30, Z - 20), 0.0, 1.0)
        level = 1.0 + light * generator.standard_normal()
        maps.append(level * disc + noise * generator.standard_normal(disc.shape))
    return maps


def exchanged(one, other):
    maps = plume()
    maps[one], maps[other] = maps[other], maps[one]
    return maps


@pytest.mark.parametrize('noise', [0.0, 0.01, 0.3])
@pytest.mark.parametrize('light', [0.0, 0.05])
def test_a_growing_plume_has_every_map_in_its_place(noise, light):
    for seed in range(5):
        assert misplaced_maps(TIMES, plume(noise, light, seed), None) == []


@pytest.mark.parametrize(('one', 'other'), [(8, 9), (5, 6), (6, 12)])
def test_exchanged_maps_are_found(one, other):
    assert misplaced_maps(TIMES, exchanged(one, other), None) == [one, other]


def test_a_glare_in_one_map_is_found():
    maps = plume()
    maps[7][5:25, 5:25] += 0.8
    assert misplaced_maps(TIMES, maps, None) == [7]


def test_a_plume_that_turns_at_a_change_of_the_rates_is_not_odd():
    there = plume(noise=0.001)[:10]
    pushed_and_pulled = [*there, *reversed(there[:-1])]
    turning = Schedule((ScheduleRow(TIMES[9] + 1.0, 'well', WellRate(-1e-7)),))
    assert misplaced_maps(TIMES, pushed_and_pulled, turning) == []
    assert misplaced_maps(TIMES, pushed_and_pulled, None) == [9]


def test_few_maps_are_not_judged():
    assert misplaced_maps(TIMES, plume()[:2], None) == []


def test_flickering_light_over_a_resting_plume_is_not_odd():
    """While all pumps rest, light is all that changes: two neighbours may just be alike."""
    resting = plume(noise=0.0)[-1]
    lights = [1.0, 1.01, 0.99, 1.0, 1.03, 1.001, 0.99, 1.02, 1.01, 1.0]
    maps = [light * resting for light in lights]
    rest = Schedule((ScheduleRow(0.0, 'in', WellRate(0.0, 1.0)),))
    assert misplaced_maps(TIMES[: len(maps)], maps, rest) == []
    assert misplaced_maps(TIMES[: len(maps)], maps, None) != []


RIG = box_rig(**{'in': (0.1, 0.1)})
"""1920 ml of pores."""
MINUTES = [100.0 * number for number in range(1, 9)]
STEADY = [0.05 * number for number in range(1, 9)]
"""Mean concentrations: 96 ml more in each map, and just so much is injected."""
NAMES = [f'{number}.jpg' for number in range(1, 9)]
PUMPED = Schedule((ScheduleRow(0.0, 'in', WellRate(0.96e-6, 1.0)),))


def flat(levels: list[float]) -> list[np.ndarray]:
    return [np.full((20, 30), level) for level in levels]


def swapped(first: int, second: int) -> list[float]:
    levels = list(STEADY)
    levels[first], levels[second] = levels[second], levels[first]
    return levels


def jumped(levels: list[float], schedule: Schedule = PUMPED) -> list[int]:
    return [one.number for one in jumps(flat(levels), MINUTES, RIG, schedule)]


def test_both_swapped_photographs_are_named_with_their_neighbours() -> None:
    assert jumped(STEADY) == []
    assert jumped(swapped(1, 6)) == [1, 6]
    maps = flat(swapped(1, 6))
    known = Known(rig=RIG, pumped=PUMPED, times=MINUTES, maps=maps, scaled_maps=maps, names=NAMES)
    (remark,) = CHECK.find(known)
    assert (remark.code, remark.facts['times_s']) == ('out_of_course', [200.0, 700.0])
    assert '2.jpg shows 672 ml of tracer, the maps before and after it 96 and 288 ml' in str(remark)
    assert '7.jpg shows 192 ml' in str(remark)


@pytest.mark.parametrize('last', [0.05, 0.35])
def test_what_pumps_can_do_is_no_jump(last: float) -> None:
    """Water, or a producer, moves a plume out of the rig as fast as it came."""
    rows = (
        ScheduleRow(0.0, 'in', WellRate(0.96e-6, 1.0)),
        ScheduleRow(400.0, 'in', WellRate(-0.96e-6, 0.0)),
    )
    assert jumped([0.05, 0.1, 0.15, 0.2, 0.15, 0.1, 0.05, last], Schedule(rows)) == []


def test_sand_that_one_map_hides_is_no_jump() -> None:
    hidden = flat(STEADY)
    hidden[4] = hidden[4].copy()
    hidden[4][:, :20] = np.nan
    assert jumps(hidden, MINUTES, RIG, PUMPED) == []


@pytest.mark.parametrize('count', [1, 2])
def test_few_maps_or_unknown_rates_tell_nothing(count: int) -> None:
    assert jumps(flat(STEADY)[:count], MINUTES[:count], RIG, PUMPED) == []
    assert jumps(flat(swapped(1, 6)), MINUTES, RIG, Schedule(())) == []


def test_light_that_fails_while_pumps_rest_is_told_by_the_tracer_only() -> None:
    """Two rules answered one question: `image` asked for jumps of tracer, `diagnose` for shapes.

    Both are right where the other is blind. Shapes say nothing while pumps rest; jumps say nothing
    of neighbours that were exchanged, since the pumps may do that.
    """
    rest = Schedule((ScheduleRow(0.0, 'in', WellRate(0.0, 1.0)),))
    dim = flat([0.4, 0.4, 0.4, 0.2, 0.4, 0.4, 0.4, 0.4])
    assert misplaced_maps(MINUTES, dim, rest) == []
    assert [one.number for one in jumps(dim, MINUTES, RIG, rest)] == [3]
    assert jumped(swapped(4, 5)) == []
