"""Maps out of place in time are found, and no others."""

import numpy as np
import pytest

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.misplaced_maps import misplaced_maps

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
