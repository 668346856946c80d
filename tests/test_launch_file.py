"""`ros2 launch` of the twin, by launch and launch_ros themselves.

They are no wheels. Where they are installed, or their sources are on PYTHONPATH, the launch file
runs. launch_ros imports the services of components, which this graph does not use, so a stand-in
serves where they are missing.
"""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('launch.actions', reason='ros2/launch is not installed, and has no wheel')

pytestmark = pytest.mark.graph

ROOT = Path(__file__).resolve().parents[1]
SMALL_RIG = ROOT / 'rigs' / 'small' / 'rig.yaml'  # it has a camera

RUN = """
import sys
from types import ModuleType

try:
    import composition_interfaces.srv
except ModuleNotFoundError:
    services = ModuleType('composition_interfaces.srv')
    from std_srvs.srv import Trigger

    services.LoadNode = services.ListNodes = services.UnloadNode = Trigger
    sys.modules['composition_interfaces'] = ModuleType('composition_interfaces')
    sys.modules['composition_interfaces'].srv = services
    sys.modules['composition_interfaces.srv'] = services

from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription, Shutdown, TimerAction
from launch.launch_description_sources import PythonLaunchDescriptionSource

arguments = [tuple(word.split(':=', 1)) for word in sys.argv[2:]]
service = LaunchService(argv=[])
service.include_launch_description(LaunchDescription([
    IncludeLaunchDescription(
        PythonLaunchDescriptionSource(sys.argv[1]), launch_arguments=arguments
    ),
    TimerAction(period=SECONDS, actions=[Shutdown(reason='the test has seen enough')]),
]))
raise SystemExit(service.run())
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """The nodes as colcon installs them: a mark of each package, and a program of each node."""
    prefix = tmp_path / 'install'
    marks = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
    marks.mkdir(parents=True)
    for setup in ROOT.glob('porotwin_*/setup.py'):
        package = setup.parent.name
        (marks / package).touch()
        for node, module in re.findall(r"'(\w+_node) = ([\w.]+):main'", setup.read_text()):
            program = prefix / 'lib' / package / node
            program.parent.mkdir(parents=True, exist_ok=True)
            program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
            program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return prefix


def launched(installed: Path, seconds: float, **arguments: object) -> str:
    """Run the launch file for at most so many seconds [s]; return all that it writes."""
    script = RUN.replace('SECONDS', str(seconds))
    words = [f'{name}:={value}' for name, value in arguments.items()]
    paths = os.pathsep.join([str(installed), os.environ.get('AMENT_PREFIX_PATH', '')])
    file = ROOT / 'porotwin_bringup' / 'launch' / 'twin.launch.py'
    ran = subprocess.run(
        [sys.executable, '-c', script, str(file), *words],
        env={**os.environ, 'AMENT_PREFIX_PATH': paths, 'ROS_LOG_DIR': str(installed / 'log')},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        cwd=installed,
    )
    return ran.stdout


def test_the_graph_starts_with_paths_as_they_are(installed: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'run #2: 1e3'  # YAML would cut it at the hash
    folder.mkdir()
    rig = folder / 'rig.yaml'
    rig.write_text(SMALL_RIG.read_text())
    params = ROOT / 'porotwin_bringup' / 'config' / 'parameters.yaml'
    said = launched(installed, 20.0, rig=rig, photos=folder, params=params)
    assert said.count('process started with pid') >= 8, said
    assert 'process has died' not in said.split('sending signal')[0], said


def test_a_node_that_refuses_its_parameters_ends_the_launch(
    installed: Path, tmp_path: Path
) -> None:
    said = launched(installed, 60.0, rig=tmp_path / 'nowhere.yaml', photos=tmp_path)
    assert 'was required: shutting down' in said, said
    assert 'nowhere.yaml: no such file' in said
    assert 'the test has seen enough' not in said
