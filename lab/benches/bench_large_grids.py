"""The cost of a simulation per cell and frame, from ordinary grids to a map with cells of 1 mm.

The case is 100 frames on a rig as large as the large FluidFlower rig, with wavy layers of sand. The
time includes the flow and everything else but the start of the process.
"""

import time
from collections import deque
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lab.benches.peers.child import most_memory_kb
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Boundaries, Rig, Well, rig_from_maps
from porotwin_solver.model.engine import PROCESSOR
from porotwin_solver.model.simulation import simulated_maps

GRIDS = ((280, 150), (747, 450), (3000, 1500))
"""Columns and rows: cells of 10 mm, of 3.5 mm, and of 1.0 mm."""

LARGE_FRAMES, FRAME_S = 100, 144.0
"""Number of frames, and the time between them [s]: four hours together."""

WIDTH_M, HEIGHT_M = 2.8, 1.5
"""Size of the rig [m]."""

RATE_ML_H = 500.0
"""Rate of each well [ml/h]; the substeps of a cell grow with it."""

SANDS_M2 = (1.1e-9, 6.0e-9, 1.8e-10, 4.2e-9)
"""Permeability of the layers from below [m^2]."""


class LargeGridCost(NamedTuple):
    """The cost of a simulation.

    processor_s: processor time [s].
    wall_s: time on the clock [s].
    nanoseconds: processor time per cell and frame [ns].
    memory_gb: most memory of the process meanwhile [GB].
    lost: share of the injected tracer that left the rig through its open top [-].
    last: the last map, (rows, columns).
    """

    processor_s: float
    wall_s: float
    nanoseconds: float
    memory_gb: float
    lost: float
    last: FloatArray


def large_bench_rig() -> Rig:
    """Return a rig with wavy layers of sand and two wells."""
    nz, nx = 150, 280
    x, z = (np.arange(nx) + 0.5) / nx, (np.arange(nz) + 0.5) / nz
    level = z[:, None] - 0.03 * np.sin(2.0 * np.pi * x)[None, :]
    layer = np.clip((level * len(SANDS_M2)).astype(int), 0, len(SANDS_M2) - 1)
    return rig_from_maps(
        {
            'name': 'large',
            'width_m': WIDTH_M,
            'height_m': HEIGHT_M,
            'viscosity_pa_s': 1.0e-3,
            'density_kg_m3': 998.0,
            'boundaries': Boundaries(),
            'wells': {'left': Well(x_m=0.9, z_m=0.33), 'right': Well(x_m=1.75, z_m=0.70)},
        },
        {'depth_m': 0.018, 'porosity': 0.44, 'permeability_m2': np.array(SANDS_M2)[layer]},
    )


def large_grid_cost(
    columns: int, rows: int, *, frames: int = LARGE_FRAMES, device: str = PROCESSOR
) -> LargeGridCost:
    """Return the cost of `frames` maps on a grid of `columns` x `rows` cells.

    `device` is as in `Engine`.

    Raises:
        InputError: as `simulated_maps`.
    """
    rig = large_bench_rig()
    rate, cells = from_ml_h(RATE_ML_H), columns * rows
    schedule = Schedule.constant({'left': WellRate(rate, 1.0), 'right': WellRate(rate, 1.0)})
    times = FRAME_S * np.arange(1, frames + 1)
    Path('/proc/self/clear_refs').write_text('5', encoding='ascii')  # Linux: a new peak begins
    begin, clock = time.process_time(), time.perf_counter()
    grid = rig.grid(columns, rows)
    maps = simulated_maps(rig, schedule, times, grid=grid, preset='fast', device=device)
    (last,) = deque(maps, maxlen=1)  # all of them would take more memory than the model
    seconds, wall = time.process_time() - begin, time.perf_counter() - clock
    tracer = float(last.sum()) * WIDTH_M * HEIGHT_M / cells * 0.018 * 0.44
    return LargeGridCost(
        seconds,
        wall,
        1e9 * seconds / cells / frames,
        most_memory_kb() / 1e6,
        1.0 - tracer / (2.0 * rate * float(times[-1])),
        last,
    )
