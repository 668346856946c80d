"""Tests of the closed loop on the virtual rig.

The same seed gives the same run on any machine, and beside another rig on the same machine.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import running_graph

from porotwin_core.rig import load_rig, write_rig
from porotwin_core.ros import conversions
from porotwin_hub.launching.graph import (
    GraphSettings,
    NodeDescription,
    in_namespace,
    operator_node,
    twin_nodes,
)
from porotwin_msgs.msg import CleanState
from porotwin_rig.camera import camera_before

pytestmark = [pytest.mark.graph, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[1]
PHOTO_WIDTH = 640


def run_loop(folder: Path, domain: int, *, namespace: str) -> tuple[list[Any], list[Any]]:
    """Return the states and setpoints of two minutes of the closed loop."""
    folder.mkdir()
    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    camera = camera_before(rig, PHOTO_WIDTH).description()
    write_rig(rig.model_copy(update={'camera': camera}), folder / 'rig.yaml')
    settings = GraphSettings(
        rig=folder / 'rig.yaml', grid='47x28', evaluations=4, use_sim_time=True
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
    with running_graph(in_namespace(nodes, namespace), folder, domain) as graph:
        graph.listener.wait_for(
            'the end of the experiment',
            lambda: any(
                event.cause == CleanState.FINISHED for event in graph.messages['asset/clean_state']
            ),
            timeout=180.0,
        )
        graph.wait_for_messages('wells/setpoint', 5)
        return graph.messages['asset/new_state'], graph.messages['wells/setpoint']


def test_the_same_seed_gives_the_same_run_also_beside_another_rig(
    tmp_path: Path, new_domain: Callable[[], int]
) -> None:
    """Two rigs run side by side, so that each is the other one's disturbance."""
    with ThreadPoolExecutor() as pool:
        one = pool.submit(run_loop, tmp_path / 'one', new_domain(), namespace='/rig1')
        two = pool.submit(run_loop, tmp_path / 'two', new_domain(), namespace='/rig2')
        states, setpoints = one.result()
        other_states, other_setpoints = two.result()
    assert len(states) == len(other_states) == 5
    for first, second in zip(states, other_states, strict=True):
        np.testing.assert_array_equal(values(first), values(second))
    assert not np.array_equal(values(states[-1]), values(states[-2]), equal_nan=True)
    assert setpoints == other_setpoints


def values(state: Any) -> np.ndarray:
    """Return the map of a state."""
    return conversions.tracer_from_msg(state.tracer)[0]
