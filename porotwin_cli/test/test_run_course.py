"""Moments between the maps of a long run."""

import numpy as np
import pytest

from porotwin_cli.recorded.run_course import run_course
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import load_rig
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.simulation import simulate

DAY_S = 86400.0


def test_maps_that_follow_soon_get_no_moments_between_them() -> None:
    times = [0.0, 30.0, 60.0, 600.0]
    assert run_course(times, 15.0) == [(time, True) for time in times]
    assert run_course([], 15.0) == []


@pytest.mark.parametrize('times', [[5 * DAY_S], [0.0, 5 * DAY_S], [DAY_S, DAY_S, 5 * DAY_S]])
def test_maps_that_lie_days_apart_get_moments_at_whole_steps(times) -> None:
    course = run_course(times, 15.0)
    assert [moment.time for moment in course if moment.is_map] == times
    ordered = np.array([moment.time for moment in course])
    assert 20 <= len(course) <= 24
    assert (np.diff(ordered) >= 0).all()
    assert np.diff(ordered).max() <= 5 * DAY_S / 20
    between = np.array([moment.time for moment in course if not moment.is_map])
    np.testing.assert_allclose(between % 15.0, 0.0, atol=1e-6)


def test_moments_hardly_change_the_map() -> None:
    rig = load_rig(small_rig())
    grid = rig.grid(30, 18)
    schedule = Schedule.constant(
        {'injector': WellRate(from_ml_h(20.0), 1.0), 'producer': WellRate(from_ml_h(-20.0))}
    )
    step = longest_free_step(nominal_physics(rig, grid), schedule.largest)
    end = 1100.4 * step
    course = run_course([end], step)
    assert len(course) == 20
    with_moments = simulate(
        rig, schedule, [moment.time for moment in course], grid=grid, preset='fast'
    )
    alone = simulate(rig, schedule, [end], grid=grid, preset='fast')
    np.testing.assert_allclose(with_moments[-1], alone[-1], atol=1e-4)
