"""MODFLOW 6 on the case of `bench_solver`: GWF, and GWT with TVD; flopy writes the input before."""

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import flopy  # noqa: F401  # a missing one is named before ours is loaded

from lab.benches.bench_solver import bench_rig, bench_schedule
from lab.benches.peers.child import Problem
from lab.verification.modflow import PROGRAM, prepared_maps
from porotwin_core.geometry.grid import FloatArray

_folder = tempfile.TemporaryDirectory()


def version() -> str:
    """Return the version of the program."""
    said = subprocess.run([PROGRAM, '--version'], capture_output=True, text=True, check=True)
    return said.stdout.split()[1]


def prepare(problem: Problem) -> Callable[[], FloatArray]:
    """Return the work: the maps (times, nz, nx) that `flow_problem` describes."""
    nz, nx = problem['storage'].shape
    rig, interval = bench_rig(), float(problem['interval'])
    return prepared_maps(
        rig,
        bench_schedule(),
        [float(frame) * interval for frame in problem['frames']],
        grid=rig.grid(nx, nz),
        longest_step=interval,
        folder=Path(_folder.name),
    )
