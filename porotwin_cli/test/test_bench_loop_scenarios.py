"""The scenarios of the closed loop."""

import pytest

from porotwin_cli.bench_loop_scenarios import HIDDEN, ZONES, demo_scenario, draw_scenario
from porotwin_guard.guard import Guard
from porotwin_hub.setpoint_limits import Limits
from porotwin_rig.virtual_rig import VirtualRig


def test_a_number_and_a_seed_make_one_scenario() -> None:
    assert draw_scenario(3, 1) == draw_scenario(3, 1)


def test_another_seed_makes_other_places() -> None:
    assert draw_scenario(3, 1).rig.wells != draw_scenario(3, 2).rig.wells


def test_the_scenarios_go_through_all_kinds_of_zones_and_people() -> None:
    drawn = [draw_scenario(number, 1) for number in range(len(ZONES))]
    assert (
        len({scenario.rig.control.objective.name for scenario in drawn if scenario.rig.control})
        == 2
    )
    assert len({str(scenario.operator) for scenario in drawn}) >= 3
    assert any(scenario.effects for scenario in drawn)


def test_the_virtual_rig_knows_what_is_hidden_and_the_rig_does_not() -> None:
    scenario = draw_scenario(3, 1)
    assert len(scenario.effects) == 2
    assert {effect.name for effect in scenario.effects} <= set(HIDDEN)
    assert not scenario.rig.effects
    VirtualRig(scenario.rig, effects=scenario.effects, cell=0.03)


def test_times_are_whole_photo_intervals() -> None:
    scenario = draw_scenario(5, 1)
    assert (scenario.end - scenario.start) % scenario.photo_interval == pytest.approx(0.0)


def test_the_demo_has_the_limits_of_the_paper() -> None:
    scenario = demo_scenario()
    limits = Limits.of(scenario.rig)
    assert limits.max_rate == limits.max_total_rate
    Guard(scenario.rig, photo_interval=scenario.photo_interval)
