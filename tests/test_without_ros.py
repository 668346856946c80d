"""Tests that everything but nodes and a few named modules is imported without ROS."""

import json
import subprocess
import sys
from pathlib import Path

from test_architecture import MESSAGES, MODULES, PACKAGES, ROOT, ROS, ROS_SHELLS, short

KNOWS_EVERYBODY = 'porotwin_cli'
"""The package whose modules use all others, also those that need ROS."""

IMPORT_ALL = """
import importlib, importlib.abc, json, sys

class NoRos(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {ros!r}:
            raise ModuleNotFoundError('no ROS here: ' + name)

sys.meta_path.insert(0, NoRos())
failures = {{}}
for name in {names!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        failures[name] = str(error)
print(json.dumps(failures))
"""


def needs_ros(module: Path) -> bool:
    """Return whether a module is a node, or one of the modules that may know ROS."""
    return module.name.endswith('_node.py') or short(module) in ROS_SHELLS


def dotted(module: Path) -> str:
    """Return the name of a module in an import."""
    parts = module.relative_to(ROOT).with_suffix('').parts[1:]
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


def failures_without_ros(modules: list[Path]) -> dict[str, str]:
    """Return the modules that cannot be imported in a process without ROS, with the reason."""
    script = IMPORT_ALL.format(ros=sorted(ROS | MESSAGES), names=[dotted(one) for one in modules])
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_algorithms_are_imported_without_ros() -> None:
    modules = [
        one
        for one in MODULES
        if one.relative_to(ROOT).parts[0] != KNOWS_EVERYBODY and not needs_ros(one)
    ]
    assert {one.relative_to(ROOT).parts[0] for one in modules} == set(PACKAGES) - {KNOWS_EVERYBODY}
    assert failures_without_ros(modules) == {}


def test_the_description_of_a_rig_is_read_without_ros() -> None:
    script = IMPORT_ALL.format(ros=sorted(ROS | MESSAGES), names=[])
    script += f"""
from porotwin_core.rig import load_rig
print(load_rig({str(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')!r}).name)
"""
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == 'small'


def test_nodes_and_their_helpers_need_ros() -> None:
    modules = [one for one in MODULES if short(one) in ROS_SHELLS and 'porotwin_core' in str(one)]
    assert set(failures_without_ros(modules)) == {dotted(one) for one in modules}
