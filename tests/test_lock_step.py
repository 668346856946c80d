"""Tests of the closed loop on the virtual rig: the same seed gives the same run on any machine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import running_graph

from porotwin_core import conversions
from porotwin_core.rig import load_rig, write_rig
from porotwin_hub.graph import GraphSettings, NodeDescription, operator_node, twin_nodes
from porotwin_msgs.msg import CleanState
from porotwin_rig.camera import camera_before

pytestmark = [pytest.mark.graph, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[1]
PHOTO_WIDTH = 640


def run_loop(folder: Path, domain: int) -> tuple[list[Any], list[Any]]:
    """Return the states and setpoints of two minutes of the closed loop."""
    folder.mkdir()
    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    camera = camera_before(rig, PHOTO_WIDTH).description()
    write_rig(rig.model_copy(update={'camera': camera}), folder / 'rig.yaml')
    settings = GraphSettings(
        rig=folder / 'rig.yaml', grid='94x56', evaluations=12, use_sim_time=True
    )
    asset = NodeDescription(
        'virtual_rig',
        'porotwin_rig',
        'virtual_rig_node',
        {
            'rig': str(settings.rig),
            'duration_s': 120.0,
            'seed': 5,
            'photo_width_px': PHOTO_WIDTH,
        },
    )
    nodes = [*twin_nodes(settings), operator_node(settings, asset=False), asset]
    with running_graph(nodes, folder, domain) as graph:
        graph.listener.wait_for(
            'the end of the experiment',
            lambda: any(
                event.cause == CleanState.FINISHED for event in graph.messages['asset/clean_state']
            ),
            timeout=180.0,
        )
        graph.wait_for_messages('wells/setpoint', 5, timeout=10.0)
        return graph.messages['asset/new_state'], graph.messages['wells/setpoint']


def test_the_same_seed_gives_the_same_run(tmp_path: Path, domain: int) -> None:
    first_states, first_setpoints = run_loop(tmp_path / 'first', domain)
    second_states, second_setpoints = run_loop(tmp_path / 'second', domain)
    assert len(first_states) == len(second_states) == 5
    for one, other in zip(first_states, second_states, strict=True):
        np.testing.assert_array_equal(
            conversions.tracer_from_msg(one.tracer)[0], conversions.tracer_from_msg(other.tracer)[0]
        )
    assert first_setpoints == second_setpoints
