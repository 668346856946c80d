"""Camera node and imaging node: photographs in a folder become states of the asset."""

import os
import shutil
import signal
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph import running_graph

from porotwin_core.rig import Rig, write_rig
from porotwin_core.ros.from_messages import seconds_from_msg
from porotwin_hub.launching.graph import NodeDescription
from porotwin_msgs.msg import CleanState
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Photographer

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def photographer(name: str = 'small', seed: int = 3) -> Photographer:
    rig = Rig.model_validate(
        {
            'name': name,
            'width_m': 0.934,
            'height_m': 0.562,
            'depth_m': 0.01,
            'porosity': 0.375,
            'permeability_m2': 6.57e-10,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'wells': {'injector': {'x_m': 0.3, 'z_m': 0.28}},
        }
    )
    return Photographer(rig, camera=camera_before(rig, 1000, 640), seed=seed)


def plume(radius: float) -> np.ndarray:
    z, x = np.mgrid[0:0.562:112j, 0:0.934:187j]
    return (np.hypot(x - 0.3, z - 0.28) < radius).astype(float)


def put(folder: Path, name: str, data: bytes) -> None:
    """Write a photograph under a hidden name and rename it when it is complete."""
    (folder / f'.{name}').write_bytes(data)
    shutil.move(folder / f'.{name}', folder / name)


def test_good_photographs_become_states_and_bad_ones_diagnostics(
    tmp_path: Path, domain: int
) -> None:
    camera = photographer()
    photos = tmp_path / 'photos'
    photos.mkdir()
    write_rig(camera.rig, tmp_path / 'rig.yaml')
    nodes = [
        NodeDescription(
            'imaging',
            'porotwin_imaging',
            'imaging_node',
            {
                'rig': str(tmp_path / 'rig.yaml'),
                'grid': '93x56',
                'experiment_start': str(tmp_path / 'start.json'),
            },
        ),
        NodeDescription(
            'camera',
            'porotwin_imaging',
            'camera_node',
            {'source': f'folder:{photos}', 'patience': 2.0},
        ),
    ]
    with running_graph(nodes, tmp_path / 'run', domain) as graph:
        diagnostics: list[DiagnosticStatus] = []
        graph.listener.node.create_subscription(
            DiagnosticArray, '/diagnostics', lambda array: diagnostics.extend(array.status), 10
        )
        graph.wait_until_heard('imaging')
        put(photos, 'lens_cap.jpg', cv2.imencode('.jpg', np.zeros((640, 1000, 3)))[1].tobytes())
        graph.wait_for_log('camera', 'cannot be the baseline')
        put(photos, '00.jpg', camera.baseline())
        graph.wait_for_log('imaging', 'baseline:')
        first = camera.photograph(plume(0.05), time=30.0)
        put(photos, '01.jpg', first)
        states: list[Any] = graph.wait_for_messages('asset/new_state', 1)
        assert graph.messages['asset/clean_state'][0].cause == CleanState.START

        put(photos, '02.jpg', first)  # a camera that repeats its last photograph
        graph.wait_for_log('camera', 'is a duplicate of')
        put(photos, '03.jpg', photographer(seed=99).photograph(plume(0.05), time=50.0))
        graph.wait_for_log('imaging', 'does not match the baseline')
        put(photos, '04.jpg', first[: len(first) // 2])
        graph.wait_for_log('camera', 'truncated or broken')
        put(photos, '05.jpg', camera.photograph(plume(0.06), time=60.0))
        graph.wait_for_messages('asset/new_state', 2)
        put(photos, '06.jpg', camera.photograph(plume(0.06), time=45.0))
        graph.wait_for_log('camera', 'out of order')
        put(photos, '07.jpg', camera.photograph(plume(0.07), time=90.0))
        graph.wait_for_messages('asset/new_state', 3)
        put(photos, '08.jpg', camera.photograph(plume(0.08), time=420.0))
        graph.wait_for_messages('asset/new_state', 4)

        assert [state.sequence for state in states] == [0, 1, 2, 3]
        np.testing.assert_allclose(
            [seconds_from_msg(s.time_step) for s in states], [0, 30, 30, 0], atol=1e-3
        )
        assert [clean.cause for clean in graph.messages['asset/clean_state']] == [
            CleanState.START,
            CleanState.INTERRUPTED,
        ]
        mass = [np.nansum(state.tracer.concentration) for state in states]
        assert (np.diff(mass) > 0).all()
        assert not states[0].calibrated
        assert 0 < states[0].noise < 0.1
        assert len(states[0].deviation) == len(states[0].systematic) > 0
        complaints = {one.message for one in diagnostics if one.level == DiagnosticStatus.ERROR}
        for text in ('duplicate', 'does not match', 'truncated or broken', 'out of order'):
            assert sum(text in complaint for complaint in complaints) == 1

        lines = graph.log('imaging').count('baseline:')
        os.kill(graph.processes.process('imaging').pid, signal.SIGKILL)
        graph.listener.wait_for(
            'imaging to start again',
            lambda: graph.log('imaging').count('baseline:') > lines,
        )
        put(photos, '09.jpg', camera.photograph(plume(0.09), time=450.0))
        graph.wait_for_messages('asset/new_state', 5)
        restarted = graph.messages['asset/clean_state'][-1]
        assert restarted.cause == CleanState.INTERRUPTED, restarted.reason
        assert restarted.reason == 'imaging was started again'


def test_states_wait_for_the_baseline_of_the_protocol_with_a_warning(
    tmp_path: Path, domain: int
) -> None:
    camera = photographer()
    write_rig(camera.rig, tmp_path / 'rig.yaml')
    photos = tmp_path / 'photos'
    photos.mkdir()
    protocol = photos / 'imaging.csv'
    protocol.write_text('time_s,path,role\n10,0a.jpg,state\n20,0b.jpg,state\n')
    nodes = [
        NodeDescription(
            'imaging',
            'porotwin_imaging',
            'imaging_node',
            {'rig': str(tmp_path / 'rig.yaml'), 'grid': '93x56'},
        ),
        NodeDescription(
            'camera', 'porotwin_imaging', 'camera_node', {'source': f'folder:{photos}'}
        ),
    ]
    with running_graph(nodes, tmp_path / 'run', domain) as graph:
        graph.wait_until_heard('imaging')
        put(photos, '0a.jpg', camera.photograph(plume(0.03), time=10.0))
        put(photos, '0b.jpg', camera.photograph(plume(0.04), time=20.0))
        graph.wait_for_log('imaging', 'no baseline yet, photographs wait for one')
        graph.wait_for_log('camera', 'state photograph 0b.jpg')
        protocol.write_text(protocol.read_text() + '0,00.jpg,baseline\n30,01.jpg,state\n')
        put(photos, '01.jpg', camera.photograph(plume(0.05), time=30.0))
        put(photos, '00.jpg', camera.baseline())
        states = graph.wait_for_messages('asset/new_state', 3)
        np.testing.assert_allclose(
            [seconds_from_msg(s.time_step) for s in states], [0, 10, 10], atol=1e-3
        )
        assert len(graph.messages['asset/clean_state']) == 1
        # a restarted camera declares a photograph with tracer a baseline
        protocol.write_text(protocol.read_text() + '40,02.jpg,baseline\n60,03.jpg,state\n')
        put(photos, '02.jpg', camera.photograph(plume(0.09), time=40.0))
        graph.wait_for_log('imaging', 'as a new baseline it shows tracer on')
        put(photos, '03.jpg', camera.photograph(plume(0.09), time=60.0))
        first, *_, second = graph.wait_for_messages('asset/new_state', 4)
        assert second.sequence == 3
        assert np.nansum(second.tracer.concentration) > np.nansum(first.tracer.concentration)
