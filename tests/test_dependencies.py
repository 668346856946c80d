"""Every library that a package imports comes from rosdep or from pip, on a ROS machine as well."""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))
BRINGUP = 'porotwin_bringup'
XML = [*sorted(ROOT.glob('porotwin_*/package.xml')), ROOT / 'setup/metapackage/package.xml']

ROSDEP_KEYS = {
    'aiohttp': 'python3-aiohttp',
    'ament_index_python': 'ament_index_python',
    'cftime': 'python3-cftime',
    'cv2': 'python3-opencv',
    'jinja2': 'python3-jinja2',
    'matplotlib': 'python3-matplotlib',
    'netCDF4': 'python3-netcdf4',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'PIL': 'python3-pil',
    'psutil': 'python3-psutil',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'serial': 'python3-serial',
    'torch': 'python3-torch',
    'typer': 'python3-typer',
    'yaml': 'python3-yaml',
}
"""Keys of rosdep by the name in an import.

All stand in rosdep/python.yaml of ros/rosdistro (read in August 2026) with a package for Ubuntu.
"""

ROS_PACKAGES = {
    'builtin_interfaces', 'diagnostic_msgs', 'launch', 'launch_ros', 'lifecycle_msgs',
    'rcl_interfaces', 'rclpy', 'rosgraph_msgs', 'rosidl_default_generators',
    'rosidl_default_runtime', 'sensor_msgs', 'std_msgs', 'std_srvs', 'action_msgs',
    'ament_cmake', 'python3-pytest',
}  # fmt: skip
"""Keys that ROS 2 Jazzy and every machine with it know."""

ONLY_BENCHES = {'fipy', 'pysindy'}
"""Imported by `./porotwin bench` alone, and installed from setup/requirements/test.txt."""


def pip_names() -> set[str]:
    """Return the libraries that pip brings to a ROS machine."""
    lines = (ROOT / 'setup' / 'ros_machine.txt').read_text(encoding='utf-8').splitlines()
    return {re.split('[<>=]', line)[0] for line in lines if line and not line.startswith('#')}


@cache
def third_party(package: str) -> set[str]:
    """Return the top-level names that a package imports and that are not Python's own."""
    names: set[str] = set()
    for path in [*(ROOT / package / package).rglob('*.py'), *(ROOT / package).glob('launch/*.py')]:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                names.add(node.module.split('.')[0])
    return {name for name in names - sys.stdlib_module_names - {package} if name != '__future__'}


def declared(package: str) -> set[str]:
    """Return all keys of a package.xml."""
    text = (ROOT / package / 'package.xml').read_text(encoding='utf-8')
    return set(re.findall(r'<\w*depend>([^<]+)<', text))


@pytest.mark.parametrize('package', [*PACKAGES, BRINGUP])
def test_every_import_is_named_by_a_key_or_brought_by_pip(package: str) -> None:
    keys = declared(package)
    missing = {
        name
        for name in third_party(package) - pip_names() - ONLY_BENCHES
        if ROSDEP_KEYS.get(name, name) not in keys
    }
    assert not missing, f'{package}/package.xml or setup/ros_machine.txt lacks {sorted(missing)}'


@pytest.mark.parametrize('package', PACKAGES)
def test_a_package_says_what_pip_brings(package: str) -> None:
    keys = declared(package)
    text = (ROOT / package / 'package.xml').read_text(encoding='utf-8')
    told = re.search(r'<!-- by pip, from setup/ros_machine.txt: (.+) -->', text)
    wanted = {
        name
        for name in third_party(package) & pip_names()
        if ROSDEP_KEYS.get(name, name) not in keys
    }
    assert set(told[1].split() if told else ()) == wanted


@pytest.mark.parametrize('path', XML, ids=lambda path: path.parent.name)
def test_a_package_names_its_people_and_its_page(path: Path) -> None:
    root = ElementTree.parse(path).getroot()
    for name in ('name', 'version', 'description', 'maintainer', 'license', 'url', 'author'):
        assert root.findtext(name), f'{path}: no {name}'


def test_the_metapackage_names_all_packages() -> None:
    found = set(re.findall(r'<exec_depend>(\w+)<', XML[-1].read_text(encoding='utf-8')))
    assert found == {path.parent.name for path in XML[:-1]}


@pytest.mark.parametrize('package', [*PACKAGES, 'porotwin_msgs', BRINGUP])
def test_every_key_exists(package: str) -> None:
    known = {*ROSDEP_KEYS.values(), *ROS_PACKAGES, *PACKAGES, 'porotwin_msgs'}
    unknown = declared(package) - known
    assert not unknown, f'rosdep does not know {sorted(unknown)}; or name them in this test'


def test_the_launch_file_names_the_packages_that_it_starts() -> None:
    graph = (ROOT / 'porotwin_hub/porotwin_hub/launching/graph.py').read_text(encoding='utf-8')
    started = set(re.findall(r"'(porotwin_\w+)'", graph)) & set(PACKAGES) - {'porotwin_hub'}
    assert len(started) > 5
    assert started | {'porotwin_hub'} <= declared(BRINGUP)


OLD_PYDANTIC = "VERSION = '1.10.14'\n"


@pytest.mark.graph
def test_an_old_pydantic_is_one_line(tmp_path: Path) -> None:
    (tmp_path / 'pydantic.py').write_text(OLD_PYDANTIC)
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    for arguments in (
        ['-m', 'porotwin_hub.operator_node'],
        ['-m', 'porotwin_cli', 'up', '--rig', 'rig.yaml', '--photos', '.'],
    ):
        ran = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, 'PYTHONPATH': path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 2, ran.stderr
        assert 'pydantic 1.10.14 is too old' in ran.stderr
        assert len(ran.stderr.strip().splitlines()) == 1
