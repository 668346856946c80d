"""Tubes between pumps and wells: their water leaves before the tracer behind it."""

from dataclasses import replace

import pytest

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.coefficients.tubes import through_tubes

ONE_ML_S = 1e-6
"""A rate of 1 ml/s."""


def commanded(*rows: tuple[float, float, float]) -> Schedule:
    """Return the schedule of the injector from times [s], rates [ml/s] and concentrations."""
    return Schedule(
        tuple(ScheduleRow(t, 'injector', WellRate(q * ONE_ML_S, c)) for t, q, c in rows)
    )


@pytest.fixture
def physics(rig):
    """The small rig with 30 ml of water in the tube of the injector."""
    return replace(nominal_physics(rig, rig.grid(31, 19)), dead_volumes={'injector': 30e-6})


def leaving(schedule: Schedule, physics, *times: float) -> list[float]:
    """Return the concentrations [-] that leave the tube at `times` [s]."""
    found = through_tubes(schedule, physics)
    return [found.at(time)['injector'].concentration for time in times]


def test_each_concentration_leaves_one_volume_later(physics) -> None:
    schedule = commanded((0.0, 1.0, 1.0), (100.0, 2.0, 0.5), (200.0, 2.0, 0.0))
    times = (29.9, 30.1, 114.9, 115.1, 214.9, 215.1, 1e6)
    assert leaving(schedule, physics, *times) == [0.0, 1.0, 1.0, 0.5, 0.5, 0.0, 0.0]


def test_the_water_rests_with_its_pump(physics) -> None:
    schedule = commanded((0.0, 1.0, 1.0), (20.0, 0.0, 1.0), (500.0, 1.0, 1.0))
    assert leaving(schedule, physics, 19.0, 509.9, 510.1) == [0.0, 0.0, 1.0]


def test_a_pump_that_delivers_half_takes_twice_as_long(physics) -> None:
    worn = replace(physics, rate_factors={'injector': 0.5})
    assert leaving(commanded((0.0, 1.0, 1.0)), worn, 59.9, 60.1) == [0.0, 1.0]


def test_as_much_water_as_before_leaves_at_all_times(physics) -> None:
    schedule = commanded((0.0, 1.0, 1.0), (100.0, 2.0, 0.5), (150.0, -1.0, 0.0))
    found = through_tubes(schedule, physics)
    for time in (0.0, 30.0, 110.0, 130.0, 160.0):
        assert found.at(time)['injector'].rate == schedule.at(time)['injector'].rate
    assert schedule.injected_stock(0.0, 150.0) - found.injected_stock(0.0, 150.0) == (
        pytest.approx(15e-6)  # half strong stock fills the tube
    )


def test_a_schedule_without_tubes_stays(rig) -> None:
    schedule = commanded((0.0, 1.0, 1.0))
    assert through_tubes(schedule, nominal_physics(rig, rig.grid(31, 19))) is schedule
