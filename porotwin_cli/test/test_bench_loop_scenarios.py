"""The scenarios of the closed loop."""

from dataclasses import replace

from porotwin_cli.bench_loop import SCENARIOS
from porotwin_cli.bench_loop_scenarios import PumpFault, demo_scenario
from porotwin_guard.guard import Guard
from porotwin_hub.setpoint_limits import Limits


def test_the_demo_has_the_limits_of_the_paper() -> None:
    scenario = demo_scenario()
    limits = Limits.of(scenario.rig)
    assert limits.max_rate == limits.max_total_rate
    Guard(scenario.rig, photo_interval=scenario.photo_interval)


def test_a_file_holds_a_scenario_with_a_fault_without_end() -> None:
    scenario = replace(demo_scenario(), faults=(PumpFault('control1', 0.0, 60.0),))
    assert SCENARIOS.validate_json(SCENARIOS.dump_json(scenario)) == scenario
