"""Every script of examples/ runs, keeps its own assertions, and writes its picture.

Each script runs in a process of its own. A server, which has imported the large libraries once,
forks these processes.
"""

import multiprocessing
import os
import runpy
import sys
from multiprocessing.context import ForkServerContext
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
SCRIPTS = sorted(path for path in EXAMPLES.glob('*.py') if path.name != 'picture.py')

LARGE = ['matplotlib.pyplot', 'scipy.optimize', 'porotwin_solver.model.simulation']
"""Modules that most scripts import."""


@pytest.fixture(scope='module')
def server() -> ForkServerContext:
    """Makes processes that have imported the large modules already."""
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload(LARGE)
    return context


def run_script(script: Path, folder: Path, output: Path) -> None:
    """Run a script as Python does on the command line, with `folder` as its argument."""
    with output.open('w') as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    os.chdir(folder)
    sys.argv = [str(script), str(folder)]
    sys.path.insert(0, str(script.parent))
    runpy.run_path(str(script), run_name='__main__')


def test_there_are_enough_examples() -> None:
    assert len(SCRIPTS) >= 8


@pytest.mark.slow
@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_writes_its_picture(
    script: Path, server: ForkServerContext, tmp_path: Path
) -> None:
    output = tmp_path / 'output.txt'
    process = server.Process(target=run_script, args=(script, tmp_path, output))
    process.start()
    process.join()
    assert process.exitcode == 0, output.read_text(encoding='utf-8')
    picture = tmp_path / f'{script.stem}.png'
    assert picture.read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_an_example_is_shown_in_the_list(script: Path) -> None:
    text = (EXAMPLES / 'README.md').read_text(encoding='utf-8')
    assert f'({script.name})' in text
    assert f'(pictures/{script.stem}.png)' in text
