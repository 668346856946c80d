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
    ('mypy', ['-m', 'mypy']),
)


def command(
    arguments: Annotated[list[str] | None, typer.Argument(help='Passed on to pytest.')] = None,
) -> None:
    """Run lint, types and all tests; with pytest arguments, only those tests.

    Example: ./porotwin test            Example: ./porotwin test porotwin_hub -k limits
    """
    failed = []
    if not arguments:
        for name, check in CHECKS:
            say(f'{name} ...')
            if subprocess.run([sys.executable, *check], cwd=ROOT, check=False).returncode != 0:
                failed.append(name)
    pytest = subprocess.run(
        [sys.executable, '-m', 'pytest', *(arguments or [])], cwd=ROOT, check=False
    )
    if pytest.returncode != 0:
        failed.append('pytest')
    if failed:
        raise WorkFailed(f'failed: {", ".join(failed)}')
