"""How the levels of water change over time."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.water_levels import Rises, WaterLevels
from porotwin_core.rates.wells import RateStep, Schedule, WellRate, mean_rates
from porotwin_core.rig import parse_rig

HEADS = {'top': 'closed', 'left': 'open', 'right': 'open', 'heads_m': {'left': 0.47, 'right': 0.45}}


def rig_with(points: list, **course: float):
    """Return a rig whose left level runs through `points` (min, m)."""
    return parse_rig(
        {
            'name': 'canals',
            'width_m': 1.0,
            'height_m': 0.4,
            'depth_m': 0.015,
            'porosity': 0.4,
            'hydraulic_conductivity_m_s': 2e-3,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'boundaries': HEADS,
            'wells': {'well': {'x_m': 0.5, 'z_m': 0.2}},
            'levels': {'left': {'points': points, **course}},
        },
        Path('rig.yaml'),
    )


def rises(levels: WaterLevels, begin: float, end: float) -> list[tuple[float, float, float]]:
    return [(low, high, found['left']) for low, high, found in levels.parts(begin, end)]


def test_parts_carry_as_much_as_the_straight_line() -> None:
    parts = rises(WaterLevels.of(rig_with([[10, '49 cm']])), 0.0, 900.0)
    volume = sum((high - low) * rise for low, high, rise in parts)
    np.testing.assert_allclose(volume, 0.5 * 600.0 * 0.02 + 300.0 * 0.02)
    assert max(high - low for low, high, _ in parts[:-1]) <= 60.0


def test_two_points_of_one_time_are_a_step() -> None:
    found = rises(WaterLevels.of(rig_with([[5, 0.47], [5, 0.50]])), 0.0, 600.0)
    assert [part[:2] for part in found] == [(0.0, 300.0), (300.0, 600.0)]
    np.testing.assert_allclose([part[2] for part in found], [0.0, 0.03])


def test_a_cycle_begins_anew_by_the_clock_of_the_experiment() -> None:
    levels = WaterLevels.of(rig_with([[2, 0.48], [2, 0.47], [4, 0.47]], every_min=4)).since(1000.0)
    first, later = (rises(levels, 1000.0 + start, 1240.0 + start) for start in (0.0, 720.0))
    np.testing.assert_allclose([part[2] for part in first], [0.0025, 0.0075, 0.0])
    np.testing.assert_allclose([part[2] for part in later], [part[2] for part in first])
    assert rises(levels, 0.0, 1000.0) == [(0.0, 1000.0, 0.0)]


def test_a_long_log_is_divided_once() -> None:
    course = Rises(tuple(60.0 * minute for minute in range(1000)), (0.0, 0.01) * 500)
    levels = WaterLevels({'left': course})
    assert course.edges is course.edges
    assert levels.moments(30.0, 240.0) == [60.0, 120.0, 180.0]


def test_a_schedule_and_a_plan_name_the_levels() -> None:
    announced = FixedPauses.of(rig_with([[1, 0.49], [2, 0.45]]))
    pumped = {'well': WellRate(1e-7, 1.0)}
    found = list(announced.in_schedule(Schedule.constant(pumped)).intervals(0.0, 120.0))
    plan = announced.in_plan([RateStep(0.0, pumped)], 0.0, 120.0)
    assert [rates for _, _, rates in found] == [step.rates for step in plan]
    np.testing.assert_allclose([step.rates['left'].rise for step in plan], [0.01, 0.0], atol=1e-12)
    assert mean_rates(found)['well'] == pumped['well']
    np.testing.assert_allclose(mean_rates(found)['left'].rise, 0.005)


@pytest.mark.parametrize(
    ('points', 'every', 'told'),
    [
        ([[5, 0.47], [4, 0.48]], None, '4 min follows 5 min'),
        ([[5, 0.47]], 4.0, '5 min lies beyond the cycle'),
        ([[5, '2 l']], None, 'such as 48 cm'),
        ([[0, 0.48]], 0.5, 'a cycle of a minute or more'),
        ([], None, 'give at least one'),
        ([[5, 0.47], [1e12, 0.48]], None, 'no experiment is longer than a year'),
    ],
)
def test_a_course_that_cannot_be_is_refused(points, every, told: str) -> None:
    with pytest.raises(InputError, match=told):
        rig_with(points, **({} if every is None else {'every_min': every}))
