"""Every requirement of the product states its oldest version, and all modules import with these."""

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OLDEST = ROOT / '.venv-oldest' / 'bin' / 'python'


def requirements(path: Path) -> dict[str, str]:
    """Return the bound of every requirement in a file, such as >=1.5."""
    lines = path.read_text(encoding='utf-8').splitlines()
    found = (re.fullmatch(r'([\w-]+)(.*)', line) for line in lines if line and line[0] != '#')
    return {match[1]: match[2] for match in found if match is not None}


BOUNDS = {
    name: bound
    for path in (ROOT / 'setup' / 'requirements').glob('*.txt')
    if path.stem not in ('ros', 'test')
    for name, bound in requirements(path).items()
}


def test_every_requirement_has_a_lower_bound_alone() -> None:
    assert {
        name: bound for name, bound in BOUNDS.items() if not re.fullmatch(r'>=[\d.]+', bound)
    } == {}


def test_a_ros_machine_gets_the_same_bounds() -> None:
    told = requirements(ROOT / 'setup' / 'ros_machine.txt')
    told.pop('colcon-common-extensions')
    assert told == {name: BOUNDS[name] for name in told}


def test_all_modules_import_with_the_oldest_versions() -> None:
    if not (ROOT / '.venv-oldest' / 'porotwin').is_file():  # written when all is installed
        pytest.skip('no environment of the oldest versions: python setup/oldest.py makes it')
    ran = subprocess.run(
        [
            OLDEST,
            '-W',
            'ignore',
            '-m',
            'pytest',
            '-q',
            '-p',
            'no:cacheprovider',
            ROOT / 'tests/test_without_ros.py',
        ],
        cwd=ROOT,
        env={name: value for name, value in os.environ.items() if not name.startswith('PYTEST')},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout
