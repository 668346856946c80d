"""Tests of the whole twin in real processes: photographs in, setpoints out."""

import importlib
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from graph import RunningGraph, running_graph
from patience import PATIENCE_S
from refused_node import refusal

from porotwin_core.basis.units import from_ml_h
from porotwin_core.clock.stamps import time_in_words
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig
from porotwin_core.ros import conversions
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.launching.graph import (
    GraphSettings,
    NodeDescription,
    live_graph,
    operator_node,
    twin_nodes,
)
from porotwin_msgs.srv import ConfirmRates
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig

pytestmark = [pytest.mark.graph, pytest.mark.slow]

GRID = '47x28'
PHOTOGRAPHS = 18
FAULTS = {13: 'truncated', 15: 'half_size', 16: 'black'}
"""Photographs that cannot be used, counted from 0."""


@pytest.fixture(scope='module')
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An experiment on the virtual rig, photographed every 30 s."""
    folder = tmp_path_factory.mktemp('session') / 'experiment'
    rig = load_rig(Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    rate = from_ml_h(500.0)
    schedule = Schedule(
        (
            ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),
            ScheduleRow(0.0, 'producer', WellRate(-rate)),
        )
    )
    make_experiment(
        folder,
        VirtualRig(rig),
        commanded=schedule,
        duration=30.0 * PHOTOGRAPHS,
        photo_interval=30.0,
        seed=11,
        photo_width_px=800,
    )
    return folder


def mock_camera(session: Path, **parameters: str | float) -> NodeDescription:
    return NodeDescription(
        'mock_camera',
        'porotwin_rig',
        'mock_camera_node',
        {'photos': str(session), 'startup_timeout_s': PATIENCE_S, **parameters},
    )


def twin_beside(session: Path, *, evaluations: int = 6) -> list[NodeDescription]:
    settings = GraphSettings(
        rig=session / 'rig.yaml', grid=GRID, evaluations=evaluations, use_sim_time=True
    )
    return [*twin_nodes(settings), operator_node(settings, asset=True)]


def test_a_camera_session_leads_to_setpoints_and_a_person_confirms_them(
    session: Path, tmp_path: Path, domain: int
) -> None:
    faults = ','.join(f'{number}:{fault}' for number, fault in FAULTS.items())
    nodes = [*twin_beside(session), mock_camera(session, period_s=1.5, faults=faults)]
    with running_graph(nodes, tmp_path, domain) as graph:
        check_setpoints(graph, Limits.of(load_rig(session)))
        check_confirmations(graph, Limits.of(load_rig(session)))
        check_unusable_photographs(graph)


def check_setpoints(graph: RunningGraph, limits: Limits) -> None:
    """Check that setpoints keep the limits and follow from photographs."""
    setpoints = graph.wait_for_messages('wells/setpoint', 6, timeout=2 * PATIENCE_S)[:6]
    reports = graph.wait_for_messages('hub/cycle', 6)
    states = graph.messages['asset/new_state']
    stamps = {conversions.time_from_msg(state.header.stamp) for state in states}
    for setpoint in setpoints:
        assert conversions.time_from_msg(setpoint.header.stamp) in stamps
        assert limits.violations(conversions.rates_from_msg(setpoint.wells)) == []
        valid = conversions.time_from_msg(setpoint.valid_until)
        assert valid == conversions.time_from_msg(setpoint.header.stamp) + 90.0
    errors = [report.prediction_error for report in reports[2:6]]
    assert all(0.0 < error < 0.5 for error in errors), errors
    # its process may have started after the first ones
    shown = f'setpoint {setpoints[-1].sequence} '
    graph.listener.wait_for(
        'the setpoint in the log of the operator',
        lambda: shown in graph.log('operator'),
    )
    seen, _ = conversions.tracer_from_msg(states[-1].tracer)
    assert np.nanmax(seen) > 0.5


def check_confirmations(graph: RunningGraph, limits: Limits) -> None:
    """Check that the hub takes the rates that a person confirms."""

    def answer(request: ConfirmRates.Request) -> ConfirmRates.Response:
        return graph.listener.answer('page', ConfirmRates, 'operator/confirm', request)

    def confirm(wells: Any = ()) -> None:
        """Confirm the newest setpoint; the next one may come before the answer."""
        message = 'not the newest'
        while 'not the newest' in message:
            newest = graph.messages['wells/setpoint'][-1].sequence
            message = answer(ConfirmRates.Request(sequence=newest, wells=wells)).outcome.message
        assert message == ''

    confirm()
    cycles = len(graph.messages['hub/cycle'])
    other = conversions.rates_to_msg(limits.setpoint(from_ml_h(1.0) * np.full(3, 123.4)))

    def predicted_again() -> bool:
        return any(
            remark.startswith('predicted again with the rates in force')
            for report in graph.messages['hub/cycle'][cycles:]
            for remark in report.remarks
        )

    confirm(other)
    graph.listener.wait_for('a prediction with the confirmed rates', predicted_again)
    unknown = answer(ConfirmRates.Request(sequence=999))
    assert 'setpoint 999 is not the newest' in unknown.outcome.message


def check_unusable_photographs(graph: RunningGraph) -> None:
    """Check that every photograph that cannot be used costs one line, and the twin goes on."""
    states = graph.wait_for_messages('asset/new_state', PHOTOGRAPHS - len(FAULTS))
    broken = {30 * (number + 1) for number in FAULTS}
    stamps = [round(conversions.time_from_msg(state.header.stamp)) for state in states]
    assert not broken & set(stamps)
    log = graph.log('imaging').splitlines()
    for moment in broken:
        told = f'photograph of {time_in_words(moment)} left out'
        lines = [line for line in log if told in line]
        assert len(lines) == 1, (moment, lines)
    last = 30 * PHOTOGRAPHS

    def reported() -> bool:
        reports = graph.messages['hub/cycle']
        return any(round(conversions.time_from_msg(r.header.stamp)) == last for r in reports)

    graph.listener.wait_for('the report on the last photograph', reported)


def test_an_unknown_well_in_rig_yaml_is_named_by_every_node(
    session: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    data = yaml.safe_load((session / 'rig.yaml').read_text())
    data['control']['wells'] = ['control1', 'control9']
    wrong = tmp_path / 'rig.yaml'
    wrong.write_text(yaml.safe_dump(data))
    nodes = twin_nodes(GraphSettings(rig=wrong, grid=GRID))
    assert len(nodes) == 5
    for node in nodes:
        main = importlib.import_module(node.module).main
        told = refusal(main, monkeypatch, capfd, rig=wrong, grid=GRID)
        assert "unknown well 'control9'" in told, node.name


def test_real_photographs_become_maps_predictions_and_setpoints(
    real_photographs: Path, tmp_path: Path, domain: int
) -> None:
    rig = yaml.safe_load((real_photographs / 'rig.yaml').read_text())
    rig['control'] = {
        'wells': ['lower'],
        'fixed': {'upper': {'rate_ml_h': 2250.0, 'concentration': 1.0}},
        'max_rate_ml_h': 2250.0,
        'max_total_rate_ml_h': 2250.0,
        'disallowed_zone_m': [[0.0, 1.05], [2.8, 1.05], [2.8, 1.25], [0.0, 1.25]],
    }
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump(rig))
    watched = tmp_path / 'photos'
    watched.mkdir()
    shutil.copy(real_photographs / 'imaging.csv', watched)
    settings = GraphSettings(
        rig=tmp_path / 'rig.yaml',
        photos=watched,
        grid='93x50',
        evaluations=4,
    )
    began = time.time()
    with running_graph(live_graph(settings), tmp_path, domain) as graph:
        graph.wait_for_log('solver', 'ready')
        # files that are there before the camera looks may be old, and get no setpoint
        graph.wait_for_log('camera', 'looking for new photographs')
        for name in ('tracer_1.jpg', 'tracer_0.jpg', 'tracer_2.jpg'):  # out of order
            data = (real_photographs / name).read_bytes()
            half = len(data) // 2
            with (watched / name).open('wb') as file:  # slowly: only whole files may be read
                file.write(data[:half])
                file.flush()
                time.sleep(1.5)
                file.write(data[half:])
        states = graph.wait_for_messages('asset/new_state', 2)
        setpoints = graph.wait_for_messages('wells/setpoint', 2)
        graph.wait_for_messages('tracer/predicted', 2)
        # the times in imaging.csv count from the start of the experiment: the files' times hold
        stamps = [conversions.time_from_msg(state.header.stamp) for state in states]
        assert began < stamps[0] < stamps[1] < time.time()
        first, grid = conversions.tracer_from_msg(states[0].tracer)
        x, z = np.meshgrid(grid.x, grid.z)
        plume = np.nan_to_num(first) > 0.3
        assert x[plume].mean() == pytest.approx(1.7, abs=0.2)  # round the upper well
        assert z[plume].mean() == pytest.approx(0.7, abs=0.2)
        rates = conversions.rates_from_msg(setpoints[-1].wells)
        assert rates['upper'] == WellRate(from_ml_h(2250.0), 1.0)
