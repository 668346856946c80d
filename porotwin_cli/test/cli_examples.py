"""Runs the command line as a user does: in this process, or in a process of its own."""

import contextlib
import io
import subprocess
import sys
from pathlib import Path
from unittest import mock

from porotwin_cli.__main__ import main

TIMEOUT_S = 200
"""Longest time for a command of a test [s]."""


def one_well_rig(width_m: float, height_m: float) -> str:
    """Return the rig.yaml of a rig that is open at the top, with an injector at half height."""
    return f"""
name: one well
width_m: {width_m}
height_m: {height_m}
depth_m: 0.01
porosity: 0.4
permeability_m2: 1.0e-10
viscosity_pa_s: 1.0e-3
density_kg_m3: 998.0
boundaries: {{top: open, bottom: closed, left: closed, right: closed}}
wells:
  injector: {{x_m: 0.1, z_m: {height_m / 2}}}
"""


def porotwin(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `./porotwin` with these arguments in this process, which has its libraries at hand.

    A process of its own takes one to three seconds of imports; `porotwin_process` starts one.
    """
    words = ['porotwin', *map(str, arguments)]
    output, errors = io.StringIO(), io.StringIO()
    status: object = 0
    with (
        mock.patch.object(sys, 'argv', words),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
    ):
        try:
            main()
        except SystemExit as end:
            status = end.code
    code = status if isinstance(status, int) else int(status is not None)
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())


def porotwin_process(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `./porotwin` with these arguments in a process of its own."""
    return subprocess.run(
        [sys.executable, '-m', 'porotwin_cli', *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT_S,
    )
