"""The rates that reach the sand agree with a free run."""

import pytest
from box_rig import box_rig

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, EffectDescription, Rig
from porotwin_solver.effects import effect
from porotwin_solver.model.rates_into_sand import rates_into_sand, rates_of_pumps
from porotwin_solver.model.simulation import simulate

PLAN = Schedule(
    (
        ScheduleRow(0.0, 'left', WellRate(2e-7, 1.0)),
        ScheduleRow(0.0, 'right', WellRate(1e-7, 0.5)),
        ScheduleRow(200.0, 'left', WellRate(1e-7, 0.8)),
    )
)
END = 300.0


def rig_with(*effects: EffectDescription, top: str = 'open') -> Rig:
    rig = box_rig(left=(0.1, 0.2), right=(0.4, 0.1))
    return rig.model_copy(update={'boundaries': Boundaries(top=top), 'effects': effects})


SLOW = effect('rate').described(well='left', factor=0.85)
LATER = effect('rate').described(well='right', factor=0.5, since=100.0)
PALE = effect('stock_strength').described(well='left', factor=0.6)
TUBE = effect('dead_volume').described(well='left', volume=5.0)


def test_a_rig_without_effects_gets_the_rates_as_they_are() -> None:
    assert rates_into_sand(rig_with(), PLAN) is PLAN
    assert rates_of_pumps(rig_with(), PLAN) is PLAN


def test_pumps_take_another_volume_from_bottles_whose_strength_does_not_count() -> None:
    found = rates_of_pumps(rig_with(SLOW, LATER, PALE, TUBE), PLAN)
    left = 0.85 * (2e-7 * 200.0 + 0.8 * 1e-7 * 100.0)
    right = 0.5 * 1e-7 * (100.0 + 0.5 * 200.0)
    assert found.injected_stock(0.0, END) == pytest.approx(left + right)


@pytest.mark.parametrize(
    'effects', [(SLOW,), (LATER,), (PALE,), (TUBE,), (SLOW, LATER, PALE, TUBE)], ids=len
)
def test_as_much_tracer_reaches_the_sand_as_a_free_run_holds(
    effects: tuple[EffectDescription, ...],
) -> None:
    rig = rig_with(*effects)
    grid = rig.grid(30, 20)
    maps = simulate(rig, PLAN, [END / 2.0, END], grid=grid, preset='fast')
    found = rates_into_sand(rig, PLAN)
    for time, values in zip((END / 2.0, END), maps, strict=True):
        held = float((values * rig.cell_pore_volume(grid)).sum())
        assert found.injected_stock(0.0, time) == pytest.approx(held, rel=1e-6)


def test_the_sinks_of_a_closed_rig_follow() -> None:
    rows = (ScheduleRow(0.0, 'left', WellRate(2e-7)), ScheduleRow(0.0, 'right', WellRate(-2e-7)))
    found = rates_into_sand(rig_with(SLOW, top='closed'), Schedule(rows)).at(0.0)
    assert found['right'].rate == pytest.approx(-0.85 * 2e-7)
