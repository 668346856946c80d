"""Tests of a replay in lock-step: the same bag gives the same maps, predictions and setpoints."""

import math
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from graph import running_graph

from porotwin_cli.kernels import compile_kernels
from porotwin_core.rig import write_rig
from porotwin_hub.launching.graph import NAMESPACE, GraphSettings, operator_node, twin_nodes
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter

pytestmark = [pytest.mark.graph, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[1]
PHOTOGRAPHS = 4
COMPARED = (
    'asset/clean_state',
    'asset/new_state',
    'asset/state_refreshed',
    'camera/baseline/compressed',
    'camera/image/compressed',
    'tracer/corrected',
    'tracer/predicted',
    'wells/measured',
    'wells/setpoint',
)
"""Topics whose messages hold nothing that depends on the machine."""


def write_short_bag(path: Path) -> Path:
    """Write the first photographs of the sample recording, with baselines, rates and rig."""
    sample = BagReader(ROOT / 'bags' / 'sample')
    image, photographs = f'{NAMESPACE}/camera/image/compressed', 0
    with BagWriter(path) as bag:
        for name, topic in sample.topics.items():
            bag.add_topic(name, topic.type_name, qos=topic.qos, definition=topic.definition)
        for message in sample.messages():
            photographs += message.topic == image
            if photographs > PHOTOGRAPHS:
                break
            bag.write(message.topic, message.data, log_time=message.log_time)
    return path


def replayed(bag: Path, folder: Path, domain: int) -> BagReader:
    """Return the bag that a twin records while `bag` is replayed to it in lock-step."""
    folder.mkdir()
    write_rig(open_recording(bag).rig, folder / 'rig.yaml')
    settings = GraphSettings(
        rig=folder / 'rig.yaml',
        grid='47x28',
        evaluations=4,
        record=folder / 'bag',
        use_sim_time=True,
    )
    nodes = [*twin_nodes(settings), operator_node(settings, asset=True)]
    command = [sys.executable, '-m', 'porotwin_recording.player_node', '--ros-args']
    parameters = [f'bag:={bag}', 'rate:=0.0', 'lockstep:=hub/cycle', 'discovery_s:=200.0']
    command += [word for value in parameters for word in ('-p', value)]
    command += ['-r', f'__ns:={NAMESPACE}']
    with running_graph(nodes, folder, domain):
        player = subprocess.run(
            command,
            env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
            capture_output=True,
            text=True,
            timeout=400,
        )
        assert player.returncode == 0, player.stderr
    return BagReader(folder / 'bag')


def contents(bag: BagReader) -> dict[str, list[bytes]]:
    """Return the compared messages by topic, byte for byte."""
    found: dict[str, list[bytes]] = {topic: [] for topic in COMPARED}
    for message in bag.messages([f'{NAMESPACE}/{topic}' for topic in COMPARED]):
        found[message.topic.removeprefix(f'{NAMESPACE}/')].append(message.data)
    return found


def reports(bag: BagReader) -> list[dict[str, Any]]:
    """Return the reports of the hub without the durations."""
    return [
        {
            name: str(value)
            for name, value in vars(bag.decode(message)).items()
            if not name.endswith('_duration')
        }
        for message in bag.messages([f'{NAMESPACE}/hub/cycle'])
    ]


def test_a_replay_in_lock_step_repeats_itself_bit_for_bit(
    tmp_path: Path, new_domain: Callable[[], int]
) -> None:
    """Two replays run side by side, so that each is the other one's disturbance."""
    compile_kernels()  # a kernel that was just compiled may round otherwise than a kept one
    bag = write_short_bag(tmp_path / 'short')
    with ThreadPoolExecutor() as pool:
        folders = (tmp_path / 'first', tmp_path / 'second')
        domains = (new_domain(), new_domain())
        first, second = pool.map(replayed, (bag, bag), folders, domains)
    assert len(contents(first)['asset/new_state']) == PHOTOGRAPHS
    assert len(contents(first)['wells/setpoint']) == PHOTOGRAPHS
    assert len(contents(first)['camera/image/compressed']) == PHOTOGRAPHS
    assert contents(first) == contents(second)
    assert reports(first) == reports(second)
    assert not any(math.isnan(float(report['objective'])) for report in reports(first))
