"""Drawing scenarios of the closed loop."""

from dataclasses import replace

import pytest

from lab.loop.bench_loop_draw import (
    HIDDEN,
    ZONE_KINDS,
    ZONES,
    draw_scenario,
    is_worth_controlling,
)
from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_rig.virtual_rig import VirtualRig


def drawn(number: int) -> LoopScenario:
    """Return a scenario that is not tried."""
    return draw_scenario(number, 1, accept=lambda _: True)


def test_a_number_and_a_seed_make_one_scenario() -> None:
    assert drawn(0) == drawn(0)


def test_another_number_makes_another_scenario() -> None:
    assert drawn(0).rig.wells != drawn(1).rig.wells
    assert drawn(0).operator != drawn(1).operator


def test_a_scenario_that_is_not_accepted_is_drawn_again() -> None:
    refused: list[LoopScenario] = []

    def third(scenario: LoopScenario) -> bool:
        refused.append(scenario)
        return len(refused) == 3

    assert draw_scenario(0, 1, accept=third).rig == refused[2].rig
    assert refused[0].rig != refused[2].rig


def test_all_kinds_of_zones_come() -> None:
    assert set(ZONE_KINDS) == set(ZONES)


def test_the_virtual_rig_knows_what_is_hidden_and_the_rig_does_not() -> None:
    scenario = drawn(0)
    assert len(scenario.effects) == 1
    assert {effect.name for effect in scenario.effects} <= set(HIDDEN)
    assert not scenario.rig.effects
    VirtualRig(scenario.rig, effects=scenario.effects, cell=0.03)


def test_pauses_of_the_injection_are_metered_and_known_before_the_rig_is_tried() -> None:
    seen: list[LoopScenario] = []

    def first(one: LoopScenario) -> bool:
        seen.append(one)
        return True

    scenario = draw_scenario(1, 1, accept=first)
    (pause,) = [fault for fault in seen[0].faults if fault.well == 'injector']
    assert pause.share == 0.0
    assert pause in scenario.faults
    assert scenario.meters


def test_times_are_whole_photo_intervals() -> None:
    scenario = drawn(0)
    assert (scenario.end - scenario.start) % scenario.photo_interval == pytest.approx(0.0)


def test_an_experiment_that_ends_before_the_zone_is_reached_is_not_worth_it() -> None:
    assert not is_worth_controlling(replace(demo_scenario(), end=900.0))
