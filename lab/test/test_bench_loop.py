"""The bench of the closed loop, with short experiments on a coarse grid."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from lab.loop import bench_loop
from lab.loop.bench_loop_eyes import BenchSettings, make_eyes
from lab.loop.bench_loop_run import run_free
from lab.loop.bench_loop_scenarios import demo_scenario
from lab.loop.bench_loop_table import summary
from porotwin_cli.running.loop_rig import LoopRig, delivered_rates
from porotwin_cli.running.loop_run import LoopFigures, run_closed
from porotwin_cli.running.loop_scenario import LoopScenario, PumpFault
from porotwin_core.basis.errors import InputError
from porotwin_hub.control.setpoint_limits import Limits

COARSE = BenchSettings(photographs=False, cell_m=0.03, rig_cell_m=0.02)
"""Seconds for everything."""


def short() -> LoopScenario:
    """Return the end of the demo's experiment: tracer is in the zone."""
    return replace(demo_scenario(), start=2400.0, end=2700.0, photo_interval=60.0)


def test_without_control_tracer_gets_into_the_zone() -> None:
    found = run_free(short(), COARSE)
    assert 0.0 < found.end_ml < 60.0
    assert found.dose_ml_min > 0.0
    assert found.water_ml == 0.0
    assert len(found.course_ml) == 6


def test_a_pump_that_stands_still_delivers_nothing_for_its_time() -> None:
    safe = Limits.of(short().rig).safe()
    faults = [PumpFault('injector', 0.0, 100.0, 200.0)]
    rates = [delivered_rates(safe, faults, time)['injector'].rate for time in (99.0, 100.0, 200.0)]
    assert rates == [safe['injector'].rate, 0.0, safe['injector'].rate]


def test_meters_show_the_mean_over_a_fault_within_an_interval() -> None:
    fault = PumpFault('injector', 0.0, 2430.0)
    rig = LoopRig(replace(short(), faults=(fault,)), COARSE)
    safe = Limits.of(short().rig).safe()
    assert rig.advance(safe)['injector'].rate == pytest.approx(0.5 * safe['injector'].rate)


def test_a_closed_loop_lowers_the_dose_and_breaks_no_limit() -> None:
    scenario = replace(short(), start=1200.0, end=2400.0, photo_interval=120.0)
    eyes = make_eyes(scenario, COARSE)
    found = run_closed(scenario, COARSE, eyes, bench_loop.TWINS['paper'])
    assert found.dose_ml_min < 0.7 * run_free(scenario, COARSE).dose_ml_min
    assert found.violations == 0
    assert 1 <= found.orders <= 10
    assert found.model_runs > 10


def test_a_bench_goes_on_where_it_stopped(tmp_path: Path) -> None:
    scenario, folder = short(), tmp_path / 'bench'
    folder.mkdir()
    figures = LoopFigures(1.0, 1.0, 1.0)
    content = {'seed': 1, **COARSE.__dict__}
    (folder / bench_loop.SETTINGS).write_text(json.dumps(content, indent=1))
    for name in bench_loop.RUNS:
        (folder / f'{scenario.name}_{name}.json').write_text(json.dumps(figures.__dict__))
    table = bench_loop.run(output=folder, settings=COARSE, drawn=[scenario])
    assert table['scenarios'][0]['dose_ml_min']['none'] == 1.0
    with pytest.raises(InputError, match='other settings'):
        bench_loop.run(output=folder, settings=BenchSettings(), drawn=[scenario])


def test_the_table_holds_every_figure_of_every_run(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = short()
    runs = {
        name: LoopFigures(dose, 1.0, 2.0, orders=orders)
        for name, dose, orders in (('none', 9.0, 0), ('paper', 4.0, 8), ('twin', 1.0, 2))
    }
    table = summary([scenario], {scenario.name: runs}, COARSE)
    (row,) = table['scenarios']
    assert row['name'] == 'demo'
    assert row['orders']['twin'] == row['twin']['orders'] == 2
    assert table['ratios']['dose, twin / paper']['of_medians'] == pytest.approx(0.25)
    bench_loop.show(table)
    assert 'violations' in capsys.readouterr().out
