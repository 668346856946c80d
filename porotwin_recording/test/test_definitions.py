"""Tests of message definitions: bags hold them with comments, and their hashes are ROS's."""

import json
import sys
from pathlib import Path

import pytest
from bag_examples import write_setpoints
from geometry_msgs.msg import PointStamped

from porotwin_msgs.msg import RigDescription, Setpoint
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.definitions import message_definition, type_hash


def test_definitions_keep_their_comments(tmp_path: Path) -> None:
    write_setpoints(tmp_path / 'run')
    definition = BagReader(tmp_path / 'run').topics['/porotwin/wells/setpoint'].definition
    assert '[m^3/s], positive injects' in definition
    assert 'MSG: builtin_interfaces/Time' in definition


@pytest.mark.parametrize('kind', [Setpoint, RigDescription, PointStamped])
def test_type_hashes_equal_those_of_the_interface_generator(kind: type) -> None:
    package, name = kind.__module__.split('.')[0], kind.__name__
    installed = Path(sys.prefix, 'share', package, 'msg', f'{name}.json')
    if not installed.is_file():
        pytest.skip(f'{installed} is not where this ROS installation keeps it')
    hashes = json.loads(installed.read_text())['type_hashes']
    expected = {entry['type_name']: entry['hash_string'] for entry in hashes}
    type_name = f'{package}/msg/{name}'
    assert type_hash(type_name, message_definition(type_name)) == expected[type_name]
