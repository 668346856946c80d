"""Speed and accuracy of the solver on this machine, with a baseline and peers in the same run.

The case is 80 min of the paper's small rig with rates that change at every photograph. The baseline
is a textbook model, written here (two-point flux, implicit first-order upwind, a sparse LU factor
for each step). Peers (`lab.benches.peers`) have processes of their own.
"""

import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from lab.benches.bench_large_grids import (
    GRIDS,
    LARGE_FRAMES,
    LargeGridCost,
    large_bench_rig,
    large_grid_cost,
)
from lab.benches.peers.child import Problem
from lab.benches.peers.peer_process import SOLVERS, run_peer
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rates.wells import Schedule, WellRate, WellRates
from porotwin_core.rig import Rig, Well
from porotwin_solver.adjoint import gradient
from porotwin_solver.coefficients.cell_threads import THREADED_CELLS, at_most, most_threads
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics, nominal_physics
from porotwin_solver.flow.flow import transmissibilities
from porotwin_solver.flow.multigrid import GridLevel
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks
from porotwin_solver.transport.transport import Sources

INTERVAL = 30.0
"""Time between two photographs and between two changes of the rates [s]."""

FRAMES = 160
"""Photographs in 80 min."""

ERROR_TIMES = (2100.0, 4800.0)
"""Times [s] of the maps whose error is measured: 35 and 80 min."""

REFERENCE_CELLS = (748, 448)
"""Columns and rows of the reference solution: four times as fine as the default grid."""

CUDA = 'cuda'
"""The graphics processor that the large grids are timed on, where there is one."""

Row = dict[str, Any]


def bench_rig() -> Rig:
    """Return the paper's small rig with its five wells."""
    return Rig(
        name='small',
        width_m=0.934,
        height_m=0.562,
        depth_m=0.010,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1.0e-3,
        density_kg_m3=998.0,
        wells={
            'injector': Well(x_m=0.235, z_m=0.235),
            'producer': Well(x_m=0.660, z_m=0.160),
            'control1': Well(x_m=0.120, z_m=0.420),
            'control2': Well(x_m=0.500, z_m=0.375),
            'control3': Well(x_m=0.760, z_m=0.460),
        },
    )


def bench_schedule() -> Schedule:
    """Return rates that change at every photograph, the same in every run."""
    rng = np.random.default_rng(2022)
    commanded = []
    for frame in range(FRAMES):
        water = rng.random(3) * 150.0
        rates = {f'control{k + 1}': WellRate(from_ml_h(rate), 0.0) for k, rate in enumerate(water)}
        rates['injector'] = WellRate(from_ml_h(500.0), 1.0)
        rates['producer'] = WellRate(from_ml_h(-500.0 - water.sum()))
        commanded.append((frame * INTERVAL, rates))
    return Schedule.from_rates(commanded)


class PlainModel:
    """Baseline: two-point flux, implicit upwind, a new sparse LU factor for every new flow."""

    def __init__(self, physics: Physics) -> None:
        """Factorise the pressure of `physics`; its top must be open, its other sides closed."""
        self.physics, self._sources_and_sinks = physics, SourcesAndSinks(physics)
        self._trans = transmissibilities(physics.grid, physics.mobility_thickness, physics.contact)
        self._pressure = splu(GridLevel.of(self._trans, pin=0.0).matrix())

    def flux(self, rates: WellRates) -> FaceField:
        """Return the flux [m^3/s] at `rates`: one solution of the pressure."""
        source = self._sources_and_sinks.sources(rates).net
        pressure = self._pressure.solve(source.ravel()).reshape(source.shape)
        flux = FaceField.zeros(self.physics.grid)
        flux.x[:, 1:-1] = -np.diff(pressure, axis=1)
        flux.z[1:-1] = -np.diff(pressure, axis=0)
        flux.z[-1] = pressure[-1]
        return flux * self._trans

    def predict(self, concentration: FloatArray, rates: WellRates, step: float) -> FloatArray:
        """Return the map (nz, nx) after one implicit step of `step` [s]."""
        flux, sources = self.flux(rates), self._sources_and_sinks.sources(rates)
        storage, nx = self.physics.storage, self.physics.grid.nx
        leaving = (
            np.maximum(flux.x[:, 1:], 0.0)
            - np.minimum(flux.x[:, :-1], 0.0)
            + np.maximum(flux.z[1:], 0.0)
            - np.minimum(flux.z[:-1], 0.0)
            + sources.outflow
        )
        from_west = np.maximum(flux.x[:, :-1], 0.0)
        from_east = np.maximum(-flux.x[:, 1:], 0.0)
        from_west[:, 0] = from_east[:, -1] = 0.0
        matrix = diags(
            [
                -np.maximum(flux.z[1:-1], 0.0).ravel(),
                -from_west.ravel()[1:],
                (storage / step + leaving).ravel(),
                -from_east.ravel()[:-1],
                -np.maximum(-flux.z[1:-1], 0.0).ravel(),
            ],
            offsets=[-nx, -1, 0, 1, nx],
        )
        right = storage / step * concentration + sources.tracer
        return splu(csc_matrix(matrix)).solve(right.ravel()).reshape(concentration.shape)


def plain_maps(rig: Rig, schedule: Schedule, grid: Grid) -> FloatArray:
    """Return the maps [-] of the plain model at ERROR_TIMES, (times, nz, nx)."""
    model = PlainModel(nominal_physics(rig, grid))
    state: FloatArray = np.zeros(grid.shape)
    maps = []
    for frame in range(FRAMES):
        state = model.predict(state, schedule.at(frame * INTERVAL), INTERVAL)
        if (frame + 1) * INTERVAL in ERROR_TIMES:
            maps.append(state)
    return np.array(maps)


def flow_problem(rig: Rig, schedule: Schedule, grid: Grid) -> Problem:
    """Return the arrays that `lab.benches.peers.flow_problem` describes."""
    physics = nominal_physics(rig, grid)
    times = np.arange(FRAMES) * INTERVAL
    wells = SourcesAndSinks(physics)
    rates = np.array([wells.sources(schedule.at(time)) for time in times])
    rates = rates.reshape(FRAMES, len(Sources._fields), -1)
    cells = np.flatnonzero(rates.any(axis=(0, 1)))
    return {
        'dx': np.array(grid.dx),
        'dz': np.array(grid.dz),
        'mobility_thickness': physics.mobility_thickness,
        'storage': physics.storage,
        'interval': np.array(INTERVAL),
        'cells': cells,
        'frames': np.array(ERROR_TIMES) / INTERVAL,
        **dict(zip(Sources._fields, rates[..., cells].swapaxes(0, 1), strict=True)),
    }


def timed(work: Callable[[], FloatArray]) -> tuple[FloatArray, float]:
    """Return the result of `work` and its CPU time [s]."""
    begin = time.process_time()
    result = work()
    return result, time.process_time() - begin


def errors(maps: FloatArray, reference: FloatArray) -> list[float]:
    """Return the relative L2 error of every map (nz, nx) against the means of a finer one."""
    relative = []
    for values, fine in zip(maps, reference, strict=True):
        exact = conservative_resample(fine, values.shape)
        relative.append(float(np.linalg.norm(values - exact) / np.linalg.norm(exact)))
    return relative


def run() -> list[Row]:
    """Return one row per model: CPU time [s] for 80 min, its ratios, errors and peak memory [GB].

    The last rows come from `bench_large_grids`.
    """
    rig, schedule = bench_rig(), bench_schedule()
    grid = rig.grid(187, 112)
    rows = model_rows(rig, schedule, grid)
    plain_seconds = rows[0]['cpu_s']
    seconds = _gradient_seconds(rig, schedule, grid)
    rows.append(
        _row('fast, gradient by 800 rates', grid, seconds, seconds / plain_seconds)
        | {'ns_per_cell_frame': _nanoseconds(seconds, grid)}
    )
    rows.extend(_interval_rows(rig, schedule, grid, plain_seconds))
    rows.extend(_large_rows(plain_seconds))
    return rows


def model_rows(rig: Rig, schedule: Schedule, grid: Grid) -> list[Row]:
    """Return the rows of 80 min: the plain model, the peers, and our presets."""
    reference = simulate(
        rig, schedule, ERROR_TIMES, grid=rig.grid(*REFERENCE_CELLS), preset='sharp'
    )
    plain, plain_seconds = timed(lambda: plain_maps(rig, schedule, grid))

    def row(name: str, on: Grid, seconds: float, maps: FloatArray) -> Row:
        early, late = errors(maps, reference)
        return _row(name, on, seconds, seconds / plain_seconds) | {
            'error_35_min': round(early, 4),
            'error_80_min': round(late, 4),
            'ns_per_cell_frame': _nanoseconds(seconds, on),
        }

    rows = [row('plain: upwind, implicit, LU', grid, plain_seconds, plain)]
    problem = flow_problem(rig, schedule, grid)
    for peer in SOLVERS:
        title, found, seconds, wall, memory = run_peer(peer, problem)
        if found is None or seconds is None:
            rows.append(_row(title, grid))
        elif found.shape != plain.shape:
            rows.append(_row(f'{title}: maps of another shape', grid))
        else:
            rows.append(row(title, grid, seconds, found) | _rounded(wall, memory))
    for preset, size in (
        ('fast', (187, 112)),
        ('accurate', (187, 112)),
        ('sharp', (187, 112)),
        ('upwind', (187, 112)),
        ('fast', (94, 56)),
        ('upwind', (374, 225)),
        ('fast', (374, 225)),
    ):
        on = rig.grid(*size)
        simulated = partial(simulate, rig, schedule, grid=on, preset=preset)
        simulated([INTERVAL])  # compiles the kernels before the timing
        found, seconds = timed(partial(simulated, ERROR_TIMES))
        rows.append(row(preset, on, seconds, found))
    ours = next(row['cpu_s'] for row in rows if row['model'] == 'accurate')
    return [
        row | {'ratio_to_accurate': row['cpu_s'] and round(row['cpu_s'] / ours, 2)} for row in rows
    ]


def _row(name: str, on: Grid, seconds: float | None = None, ratio: float | None = None) -> Row:
    """Return a row with all columns; figures that nobody knows are None."""
    return {
        'model': name,
        'grid': str(on),
        'cpu_s': seconds and round(seconds, 4),
        'wall_s': None,
        'ratio_to_plain': ratio and round(ratio, 4),
        'ratio_to_accurate': None,
        'error_35_min': None,
        'error_80_min': None,
        'ns_per_cell_frame': None,
        'memory_gb': None,
    }


def _rounded(wall: float | None, memory: float | None) -> Row:
    """Return the columns of a process."""
    return {'wall_s': wall and round(wall, 1), 'memory_gb': memory and round(memory, 2)}


def _nanoseconds(seconds: float, on: Grid) -> float:
    """Return `seconds` of 80 min per cell and frame [ns]."""
    return round(1e9 * seconds / (on.nx * on.nz) / FRAMES, 1)


def _large_rows(plain_seconds: float) -> list[Row]:
    """Return the cost of 100 frames of the large rig: with threads, and on a graphics processor."""
    missing = missing_device()
    rows = []
    for size in GRIDS:
        threaded = size[0] * size[1] >= THREADED_CELLS
        for threads in sorted({1, most_threads()}) if threaded else [1]:
            with at_most(threads):
                cost = large_grid_cost(*size)
            rows.append(_large_row(size, f'{threads} threads', cost, plain_seconds))
        if missing:
            rows.append(_large_row(size, f'no {CUDA} here', None, plain_seconds))
        else:
            on_device = large_grid_cost(*size, device=CUDA)
            difference = float(np.abs(on_device.last - cost.last).max())
            how = f'on {CUDA}, off by {difference:.1e}'
            rows.append(_large_row(size, how, on_device, plain_seconds))
    return rows


def missing_device() -> str:
    """Return why PyTorch cannot use a graphics processor here; empty if it can."""
    from porotwin_solver.transport.torch_transport import usable_device

    try:
        usable_device(CUDA)
    except InputError as error:
        return str(error)
    return ''


def _large_row(
    size: tuple[int, int], how: str, cost: LargeGridCost | None, plain_seconds: float
) -> Row:
    """Return the cost of 100 frames of the large rig; no figures where it was not run."""
    row = _row(f'fast, large rig, {LARGE_FRAMES} frames, {how}', large_bench_rig().grid(*size))
    if cost is None:
        return row
    return row | {
        'cpu_s': round(cost.processor_s, 1),
        'ratio_to_plain': round(cost.processor_s / plain_seconds, 3),
        'ns_per_cell_frame': round(cost.nanoseconds, 1),
        **_rounded(cost.wall_s, cost.memory_gb),
    }


def _gradient_seconds(rig: Rig, schedule: Schedule, grid: Grid) -> float:
    times = np.arange(1, FRAMES + 1) * INTERVAL

    def cost(_: int, seen: FloatArray) -> tuple[float, FloatArray]:
        return float(seen.sum()), np.ones_like(seen)

    work = partial(gradient, rig, schedule, grid=grid, preset='fast', by_concentration=False)
    work(times=times[:1], cost=cost)  # compiles the kernels before the timing
    begin = time.process_time()
    work(times=times, cost=cost)
    return time.process_time() - begin


def _interval_rows(rig: Rig, schedule: Schedule, grid: Grid, plain_seconds: float) -> list[Row]:
    """Return the time of one interval after 40 min: the live loop waits that long."""
    rows = []
    for preset, size in (('fast', grid), ('fast', rig.grid(747, 450))):
        model = Model(rig, size, preset=preset)
        coarse = simulate(rig, schedule, [2400.0], grid=grid, preset='fast')[0]
        state = conservative_resample(coarse, size.shape)
        model.prepare()
        rates = schedule.at(2400.0)
        _, seconds = timed(lambda: model.predict(state, rates, INTERVAL))  # noqa: B023
        name, ratio = f'{preset}, one interval of 30 s', seconds * FRAMES / plain_seconds
        nanoseconds = _nanoseconds(seconds * FRAMES, size)
        rows.append(_row(name, size, seconds, ratio) | {'ns_per_cell_frame': nanoseconds})
    return rows


def main() -> None:
    """Print the table and the peak memory of the process."""
    rows = run()
    for row in rows:
        print('  '.join(f'{key}={value}' for key, value in row.items()))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000.0
    print(f'peak memory {peak:.0f} MB', file=sys.stderr)


if __name__ == '__main__':
    main()
