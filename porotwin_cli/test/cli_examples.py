"""Runs the command line as a user does, in a process of its own."""

import subprocess
import sys
from pathlib import Path

TIMEOUT_S = 200
"""Longest time for a command of a test [s]."""


def porotwin(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `./porotwin` with these arguments."""
    return subprocess.run(
        [sys.executable, '-m', 'porotwin_cli', *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT_S,
    )
