"""Runs the tests of the page's scripts in the folder `web` with node."""

import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / 'web'
NODE = shutil.which('node')
OLDEST = 20
"""The first version of node with a stable `node --test`."""


def version() -> int:
    if NODE is None:
        return 0
    text = subprocess.run([NODE, '--version'], capture_output=True, text=True, check=True).stdout
    return int(text.removeprefix('v').partition('.')[0])


@pytest.mark.skipif(version() < OLDEST, reason=f'needs node {OLDEST} or later')
@pytest.mark.parametrize('script', sorted(path.name for path in FOLDER.glob('*.test.js')))
def test_script(script: str) -> None:
    assert NODE is not None
    command = [NODE, '--test', str(FOLDER / script)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
