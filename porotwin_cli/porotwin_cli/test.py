"""./porotwin test: every check and every test."""

import subprocess
import sys
from typing import Annotated

import typer

from porotwin_cli.output import WorkFailed, say
from porotwin_cli.workspace import ROOT

CHECKS = (
    ('ruff check', ['-m', 'ruff', 'check', '.']),
    ('ruff format', ['-m', 'ruff', 'format', '--check', '.']),
)

ON_ALL_CORES = ['-n', 'auto', '--maxprocesses', '4', '--dist', 'loadfile', '--no-loadscope-reorder']

TESTS = (
    ('tests', [*ON_ALL_CORES, '-m', 'not graph']),
    ('tests of ROS 2 nodes', [*ON_ALL_CORES, '-m', 'graph and not slow']),
    ('tests of whole graphs', ['-m', 'graph and slow']),
)
"""Whole graphs run one after the other: beside other work their photographs would come late."""


def command(
    arguments: Annotated[list[str] | None, typer.Argument(help='Passed on to pytest.')] = None,
) -> None:
    """Run lint, types and all tests; with pytest arguments, only those tests.

    Example: ./porotwin test            Example: ./porotwin test porotwin_hub -k limits
    """
    chosen = [('tests', arguments)] if arguments else TESTS
    runs = [(name, ['-m', 'pytest', *options]) for name, options in chosen]
    types = None if arguments else _types()
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


def _types() -> subprocess.Popen[str]:
    """Start mypy beside the tests, in the time that they wait for nodes."""
    return subprocess.Popen(
        ['nice', '-n', '19', sys.executable, '-m', 'mypy'],
        cwd=ROOT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
