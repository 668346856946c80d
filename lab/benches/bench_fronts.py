"""Designs for sharp fronts, side by side: limiters, refinement, and characteristics.

Two cases: the one of `bench_solver`, and a slug of tracer with water behind it. Errors are relative
to the compressive scheme on cells of a sixth, which agrees with superbee on cells of an eighth
within 0.002.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lab.benches.bench_solver import ERROR_TIMES, bench_rig, bench_schedule, errors, timed
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.coefficients.cell_threads import at_most
from porotwin_solver.model.simulation import simulated_maps

DESIGNS = {
    'upwind': 'first order',
    'accurate': 'third order within superbee',
    'fast': 'superbee',
    'sharp': 'superbee with the bounds of the CFL number',
}
"""Limiters, by the preset that has them."""

PARTS = (1, 2, 3)
"""Parts into which each side of a cell is divided."""

REFERENCE_PARTS = 6
"""The same for the reference."""

SLUG_TIMES = (900.0, 1500.0)
"""Times [s] of the compared maps of the slug: in it, and after it."""

CHARACTERISTIC_PARTS = 2.5
"""Cells of the virtual rig per cell of the maps, each way."""


def slug() -> Schedule:
    """Return ten minutes of tracer, then water beside it."""
    rate = from_ml_h(500.0)
    return Schedule(
        (
            ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),
            ScheduleRow(0.0, 'producer', WellRate(-rate)),
            ScheduleRow(1000.0, 'injector', WellRate(rate, 0.0)),
            ScheduleRow(1000.0, 'control2', WellRate(0.3 * rate, 0.0)),
            ScheduleRow(1000.0, 'producer', WellRate(-1.3 * rate)),
        )
    )


def run() -> list[dict[str, Any]]:
    """Return a row for each design: CPU time [s] of 80 min on one thread, and errors [-]."""
    with at_most(1):
        cases = (bench_schedule(), ERROR_TIMES), (slug(), SLUG_TIMES)
        references = [_simulated('sharp', REFERENCE_PARTS, *case)() for case in cases]
        rows = []
        for preset, limiter in DESIGNS.items():
            for parts in PARTS:
                pumped, slugged = (_simulated(preset, parts, *case) for case in cases)
                slug_maps = slugged()  # compiles the kernels before the timing
                maps, seconds = timed(pumped)
                found = errors(maps, references[0]) + errors(slug_maps, references[1])
                rows.append(_row(limiter, parts, seconds, found))
        maps, seconds = timed(_followed)
        followed = (None, None, *errors(maps, references[1]))
        rows.append(
            _row('characteristics, the slug alone', CHARACTERISTIC_PARTS, seconds, followed)
        )
    return rows


def _simulated(
    preset: str, parts: int, schedule: Schedule, times: tuple[float, ...]
) -> Callable[[], FloatArray]:
    """Return what computes the maps (nt, nz, nx) of a design."""
    rig = bench_rig()
    grid = rig.default_grid()
    return lambda: np.array(
        list(simulated_maps(rig, schedule, times, grid=grid, preset=preset, refinement=parts))
    )


def _followed() -> FloatArray:
    """Return the maps (nt, nz, nx) of the slug by the virtual rig, which follows fronts."""
    rig = bench_rig()
    grid = rig.default_grid()
    asset = VirtualRig(rig, cell=grid.dx / CHARACTERISTIC_PARTS)
    return np.array([seen for _, seen in signals(asset, slug(), times=SLUG_TIMES, grid=grid)])


def _row(
    design: str, parts: float, seconds: float, found: Sequence[float | None]
) -> dict[str, Any]:
    names = ('35 min', '80 min', 'in the slug', 'after the slug')
    shown = [None if error is None else round(error, 4) for error in found]
    return {
        'design': design,
        'parts of a side': parts,
        'cpu_s': round(seconds, 2),
        **{f'error, {name}': error for name, error in zip(names, shown, strict=True)},
    }
