"""./porotwin test: all checks and tests."""

import subprocess
import sys
from typing import Annotated

import typer

from porotwin_cli.terminal import WorkFailed, say
from porotwin_cli.workspace import ROOT

CONTEXT_SETTINGS = {'ignore_unknown_options': True}

CHECKS = (
    ('ruff check', ['-m', 'ruff', 'check', '.']),
    ('ruff format', ['-m', 'ruff', 'format', '--check', '.']),
)

ON_ALL_CORES = ['-n', 'auto', '--maxprocesses', '4', '--dist', 'loadfile', '--no-loadscope-reorder']

WITH_NODES = ['-n', '3', *ON_ALL_CORES[2:]]
"""Three workers: nodes wait most of the time."""

AGAIN = ['--reruns', '1', '-raR']
"""A failed test of real processes runs once more, because other work on this machine may starve
them. The output says RERUN."""

TESTS = (
    ('tests', [*ON_ALL_CORES, '-m', 'not graph']),
    ('tests of ROS 2 nodes', [*WITH_NODES, *AGAIN, '-m', 'graph and not slow']),
    ('tests of whole graphs', [*ON_ALL_CORES, *AGAIN, '-m', 'graph and slow']),
)
"""Whole graphs have fewer workers than nodes: beside two others, photographs would be late."""


def command(
    arguments: Annotated[
        list[str] | None, typer.Argument(help='Arguments for pytest, such as a folder.')
    ] = None,
) -> None:
    """Run all checks and tests, or some tests.

    Without arguments: ruff, mypy and all tests. With arguments: pytest with these arguments.

    Example: ./porotwin test

    Example: ./porotwin test porotwin_hub -k limits
    """
    chosen = [('tests', arguments)] if arguments else TESTS
    runs = [(name, ['-m', 'pytest', *options]) for name, options in chosen]
    types = None if arguments else _start_mypy()
    failed = []
    for name, run in runs if arguments else (*CHECKS, *runs):
        say(f'{name} ...')
        if subprocess.run([sys.executable, *run], cwd=ROOT, check=False).returncode != 0:
            failed.append(name)
    if types is not None:
        found, _ = types.communicate()
        say(f'mypy ...\n{found.strip()}')
        if types.returncode != 0:
            failed.append('mypy')
    if failed:
        raise WorkFailed(f'failed: {", ".join(failed)}')


def _start_mypy() -> subprocess.Popen[str]:
    """Start mypy beside the tests, which often wait for nodes."""
    return subprocess.Popen(
        ['nice', '-n', '19', sys.executable, '-m', 'mypy'],
        cwd=ROOT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
