"""The scenarios of the closed loop."""

import pytest

from porotwin_cli.bench_loop_scenarios import (
    HIDDEN,
    ZONE_KINDS,
    ZONES,
    LoopScenario,
    demo_scenario,
    draw_scenario,
)
from porotwin_guard.guard import Guard
from porotwin_hub.setpoint_limits import Limits
from porotwin_rig.virtual_rig import VirtualRig


@pytest.fixture(scope='module')
def drawn() -> LoopScenario:
    """Return the first scenario."""
    return draw_scenario(0, 1)


def test_a_number_and_a_seed_make_one_scenario(drawn: LoopScenario) -> None:
    assert draw_scenario(0, 1) == drawn


def test_another_number_makes_another_scenario(drawn: LoopScenario) -> None:
    other = draw_scenario(1, 1)
    assert other.rig.wells != drawn.rig.wells
    assert other.operator != drawn.operator


def test_all_kinds_of_zones_come_and_half_are_the_papers() -> None:
    assert set(ZONE_KINDS) == set(ZONES)
    assert ZONE_KINDS.count('slope') * 2 >= len(ZONE_KINDS)


def test_the_virtual_rig_knows_what_is_hidden_and_the_rig_does_not(drawn: LoopScenario) -> None:
    assert len(drawn.effects) == 1
    assert {effect.name for effect in drawn.effects} <= set(HIDDEN)
    assert not drawn.rig.effects
    VirtualRig(drawn.rig, effects=drawn.effects, cell=0.03)


def test_times_are_whole_photo_intervals(drawn: LoopScenario) -> None:
    assert (drawn.end - drawn.start) % drawn.photo_interval == pytest.approx(0.0)


def test_the_demo_has_the_limits_of_the_paper() -> None:
    scenario = demo_scenario()
    limits = Limits.of(scenario.rig)
    assert limits.max_rate == limits.max_total_rate
    Guard(scenario.rig, photo_interval=scenario.photo_interval)
