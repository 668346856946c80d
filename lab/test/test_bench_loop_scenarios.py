"""The scenarios of the closed loop."""

from dataclasses import replace

from lab.loop.bench_loop import SCENARIOS
from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.loop_run import with_plan
from porotwin_cli.running.loop_scenario import PumpFault
from porotwin_guard.guard import Guard
from porotwin_hub.control.setpoint_limits import Limits


def test_the_demo_has_the_limits_of_the_paper() -> None:
    scenario = demo_scenario()
    limits = Limits.of(scenario.rig)
    assert limits.max_rate == limits.max_total_rate
    Guard(scenario.rig, photo_interval=scenario.photo_interval)


def test_a_file_holds_a_scenario_with_a_fault_without_end() -> None:
    scenario = replace(demo_scenario(), faults=(PumpFault('control1', 0.0, 60.0),))
    assert SCENARIOS.validate_json(SCENARIOS.dump_json(scenario)) == scenario


def test_the_twin_is_told_the_planned_pauses_and_no_fault() -> None:
    pause = PumpFault('injector', 0.0, 900.0, 1200.0)
    stops = PumpFault('injector', 0.0, 3000.0)
    weak = PumpFault('injector', 0.8)
    scenario = replace(demo_scenario(), faults=(pause, stops, weak, PumpFault('control1', 0.0)))
    control = with_plan(scenario).control
    assert control is not None
    assert control.fixed['injector'].pauses_min == ((15.0, 20.0),)
    assert control.end_min == 80.0
