"""Everything but nodes and a few named modules is imported without ROS.

`test_packaging.py` imports the algorithms from the wheel, which has the same modules.
"""

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
sys.path[:0] = {path!r}
failures, places = {{}}, {{}}
for name in {names!r}:
    try:
        places[name] = importlib.import_module(name).__file__
    except ModuleNotFoundError as error:
        failures[name] = str(error)
print(json.dumps([failures, places]))
"""


def needs_ros(module: Path) -> bool:
    """Return whether a module is a node, or one of the modules that may know ROS."""
    return module.name.endswith('_node.py') or short(module) in ROS_SHELLS


def dotted(module: Path) -> str:
    """Return the name of a module in an import."""
    parts = module.relative_to(ROOT).with_suffix('').parts[1:]
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


ALGORITHMS = [
    one
    for one in MODULES
    if one.relative_to(ROOT).parts[0] != KNOWS_EVERYBODY and not needs_ros(one)
]


def imported_without_ros(
    modules: list[Path], *, path: Path | None = None
) -> tuple[dict[str, str], dict[str, str]]:
    """Import modules in a process without ROS, from `path` if it is given.

    Returned are the modules that cannot be imported, with the reason, and the files of the others.
    """
    script = IMPORT_ALL.format(
        ros=sorted(ROS | MESSAGES),
        names=[dotted(one) for one in modules],
        path=[] if path is None else [str(path)],
    )
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=False, cwd=path
    )
    assert done.returncode == 0, done.stderr
    failures, places = json.loads(done.stdout.splitlines()[-1])
    return failures, places


def test_every_package_has_algorithms() -> None:
    assert {one.relative_to(ROOT).parts[0] for one in ALGORITHMS} == set(PACKAGES) - {
        KNOWS_EVERYBODY
    }


def test_the_description_of_a_rig_is_read_without_ros() -> None:
    script = IMPORT_ALL.format(ros=sorted(ROS | MESSAGES), names=[], path=[])
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
    failures, _ = imported_without_ros(modules)
    assert set(failures) == {dotted(one) for one in modules}
