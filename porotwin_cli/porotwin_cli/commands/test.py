"""./porotwin test: all checks and tests."""

import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Annotated

import typer

from porotwin_cli.terminal import WorkFailed, say
from porotwin_cli.workspace import ROOT
from porotwin_core.basis.parallel import YIELDING

CONTEXT_SETTINGS = {'ignore_unknown_options': True}

Runs = Sequence[tuple[str, list[str]]]
"""Names of runs, and their arguments for Python."""

CHECKS = (
    ('ruff check', ['-m', 'ruff', 'check', '.']),
    ('ruff format', ['-m', 'ruff', 'format', '--check', '.']),
)

ON_ALL_CORES = ['-n', 'auto', '--maxprocesses', '4', '--dist', 'loadfile', '--no-loadscope-reorder']

WITH_NODES = ['-n', '3', *ON_ALL_CORES[2:]]
"""Three workers: nodes wait most of the time."""

WITHOUT_NODES = ('tests', [*ON_ALL_CORES, '--timeout', '900', '-m', 'not graph'])
"""These tests give way to nodes, so that a test may take several times as long as alone."""

MARKS_OF_NODES, MARKS_OF_GRAPHS = ('mark.graph',), ('mark.graph', 'mark.slow')
"""Texts in every file with such tests. The import of all other files costs ten seconds for every
worker of pytest."""

OF_NODES = (
    ('tests of ROS 2 nodes', [*WITH_NODES, '-m', 'graph and not slow'], MARKS_OF_NODES),
    ('tests of whole graphs', [*ON_ALL_CORES, '-m', 'graph and slow'], MARKS_OF_GRAPHS),
)
"""Whole graphs have fewer workers than nodes: beside two others, photographs would be late."""

LAST = 19
"""Niceness of mypy; the tests without nodes, which compute, yield to nodes only."""


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
    if arguments:
        failed = _failures([('tests', ['-m', 'pytest', *arguments])])
    else:
        failed = _failures(CHECKS)
        nodes = [
            (name, ['-m', 'pytest', *options, *files_with(marks)])
            for name, options, marks in OF_NODES
        ]
        name, options = WITHOUT_NODES
        beside = [_Beside(nodes), _Beside([('mypy', ['-m', 'mypy'])], niceness=LAST)]
        failed += _failures([(name, ['-m', 'pytest', *options])], niceness=YIELDING)
        for work in beside:
            failed += work.finish()
    if failed:
        raise WorkFailed(f'failed: {", ".join(failed)}')


def files_with(marks: Sequence[str]) -> list[str]:
    """Return the test files with all these texts, relative to the checkout.

    Those of `tests/` come first: they take longest, and no worker should wait for them at the end.
    """
    found = (
        path.relative_to(ROOT)
        for pattern in (
            'porotwin_*/test/**/test_*.py',
            'lab/test/**/test_*.py',
            'tests/**/test_*.py',
        )
        for path in ROOT.glob(pattern)
        if all(mark in path.read_text(encoding='utf-8') for mark in marks)
    )
    return sorted(map(str, found), reverse=True)


def _failures(runs: Runs, *, niceness: int = 0) -> list[str]:
    """Run Python with the arguments of each run; return the names of those that failed."""
    failed = []
    for name, arguments in runs:
        say(f'{name} ...')
        if subprocess.run(_command(arguments, niceness), cwd=ROOT, check=False).returncode != 0:
            failed.append(name)
    return failed


def _command(arguments: list[str], niceness: int) -> list[str]:
    return ['nice', '-n', str(niceness), sys.executable, *arguments]


class _Beside(threading.Thread):
    """Runs beside other work and keeps the output until the end."""

    def __init__(self, runs: Runs, *, niceness: int = 0) -> None:
        super().__init__(daemon=True)
        self._runs, self._niceness = runs, niceness
        self._ended: list[tuple[str, subprocess.CompletedProcess[str]]] = []
        self.start()

    def run(self) -> None:
        """Run everything."""
        for name, arguments in self._runs:
            done = subprocess.run(
                _command(arguments, self._niceness),
                cwd=ROOT,
                check=False,
                text=True,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            self._ended.append((name, done))

    def finish(self) -> list[str]:
        """Wait for the end and show the output; return the names of failed runs."""
        self.join()
        for name, done in self._ended:
            say(f'{name} ...\n{done.stdout.strip()}')
        return [name for name, done in self._ended if done.returncode != 0]
