"""Programs of others that the benches run on the same problem, each in a process of its own."""

import os
import signal
import subprocess
import sys
import tempfile
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import NamedTuple

import numpy as np

from lab.benches.peers.child import PROBLEM, RESULT, Problem
from porotwin_cli.workspace import ROOT
from porotwin_core.geometry.grid import FloatArray

ENVIRONMENTS = ROOT / 'runs' / 'peers'
"""A virtual environment in the folder of this name holds a peer that does not suit ours."""

LIMIT_S = 600.0
"""The longest work of a peer [s]; a longer one is stopped."""


@dataclass(frozen=True)
class Peer:
    """A program of others.

    Attributes:
        name: in a table; its version takes the place of {}.
        module: ours that calls it, with `prepare` (see `child`) and `version`.
        package: that it imports; also its environment in `ENVIRONMENTS`, if it has one.
        home: where a user finds it, and whether it may have an environment of its own.
    """

    name: str
    module: str
    package: str
    home: str


SOLVERS = (
    Peer(
        'FiPy {}: upwind, implicit',
        'lab.benches.peers.fipy_upwind',
        'fipy',
        'pip install fipy',
    ),
    Peer(
        'MODFLOW {}: TVD',
        'lab.benches.peers.modflow_tvd',
        'flopy',
        'pip install flopy, then get-modflow :python',
    ),
    Peer(
        'PorePy {}: TPFA, upwind, implicit',
        'lab.benches.peers.porepy_upwind',
        'porepy',
        'github.com/pmgbergen/porepy, also into runs/peers/porepy',
    ),
)
"""Peers of the solver."""

IMAGERS = (
    Peer(
        'DarSIA {}',
        'lab.benches.peers.darsia_tracer',
        'darsia',
        'github.com/pmgbergen/DarSIA, also into runs/peers/darsia',
    ),
)
"""Peers of the imaging."""


class PeerAnswer(NamedTuple):
    """The answer of a peer.

    title: its name and version, or its name and why there is no answer.
    maps: as its module says; None without an answer.
    processor_s: processor time of its work [s].
    wall_s: time on the clock [s].
    memory_gb: peak memory of its process, or of the program that it calls [GB].
    """

    title: str
    maps: FloatArray | None = None
    processor_s: float | None = None
    wall_s: float | None = None
    memory_gb: float | None = None


def run_peer(peer: Peer, problem: Problem, limit_s: float = LIMIT_S) -> PeerAnswer:
    """Return the answer of `peer` to `problem`, or why there is none: missing, failed, too slow."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savez(folder / PROBLEM, **problem)
        trouble = _trouble(peer, folder, limit_s)
        answer = None if trouble else _answer(peer, folder)
        return answer or PeerAnswer(
            f'{peer.name.replace(" {}", "")}: {trouble or "its result cannot be read"}'
        )


def _answer(peer: Peer, folder: Path) -> PeerAnswer | None:
    """Return the result in `folder`; None if it is damaged."""
    try:
        with np.load(folder / RESULT) as found:
            figures = (float(found[key]) for key in PeerAnswer._fields[2:])
            return PeerAnswer(peer.name.format(found['version']), found['maps'], *figures)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _trouble(peer: Peer, folder: Path, limit_s: float) -> str:
    """Run the process of `peer`; return why it wrote no result, empty if it did."""
    own = ENVIRONMENTS / peer.package / 'bin' / 'python'
    python = own if own.exists() else Path(sys.executable)
    with Path(folder, 'said').open('w+', errors='replace') as said:
        process = subprocess.Popen(
            [python, '-m', 'lab.benches.peers.child', peer.module, folder],
            cwd=ROOT,
            env=os.environ | {'PATH': f'{python.parent}{os.pathsep}{os.environ.get("PATH", "")}'},
            stdout=subprocess.DEVNULL,
            stderr=said,
            start_new_session=True,
        )
        try:
            process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return f'stopped after {limit_s:.0f} s'
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # with the programs that it called
            process.wait()
        if (folder / RESULT).exists() and not process.returncode:
            return ''
        said.seek(0)
        lines = said.read().strip().splitlines() or [f'ended with code {process.returncode}']
    if f"No module named '{peer.package}'" in lines[-1]:
        return f'not installed ({peer.home})'
    return shorten(lines[-1], 90)
