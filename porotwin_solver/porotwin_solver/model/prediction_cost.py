"""The cost of a prediction, estimated before it runs: cells, time steps and seconds.

The work of a splitting step is the sum over all cells of the substeps that their CFL number asks
for (`local_time_steps`). The flow is solved on a coarse grid, its velocities give the CFL numbers
on the true one. The integral of the speed over the rig converges quickly, although the speed next
to a well does not.
"""

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_core.rig.coarse_grid import COARSE_CELLS
from porotwin_solver.coefficients.physics import Leak, SourceSink, nominal_physics
from porotwin_solver.flow.pressure import LARGEST_FACTOR
from porotwin_solver.model.engine import LONGEST_STEP, Engine, State
from porotwin_solver.model.presets import preset_named
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.transport import CFL_LIMIT

TRIAL_CELLS = 10_000
"""Cells of the grid for timing this machine."""

TRIAL_STEPS = 5
"""Splitting steps of the trial."""

SECONDS_PER_SUBSTEP = {
    Scheme.UPWIND: 0.7e-8,
    Scheme.SUPERBEE: 1.0e-8,
    Scheme.THIRD_ORDER: 1.3e-8,
    Scheme.COMPRESSIVE: 1.0e-8,
}
"""Time of one substep of one cell [s], on an idle server with two cores (small rig, 374x224)."""

SECONDS_PER_STEP = 1e-4
"""Time of one splitting step beside the substeps of its cells [s], on the same machine."""

SECONDS_PER_LARGE_FLOW = 1.8e-6
"""Time for solving the flow once by multigrid, per well and cell [s], on the same machine."""

SECONDS_PER_FLOW = 4e-9
"""Time for factorising and solving the flow once, per well and power 1.5 of the cells [s], on the
same machine. The power belongs to nested dissection (George, SIAM J. Numer. Anal. 10 (1973))."""


SPLIT = 1.5
"""Mean number of parts of a time step from which it counts as split."""


@dataclass(frozen=True)
class PredictionCost:
    """The cost of one prediction.

    cells: of the grid for flow and transport, refined by the preset.
    refinement: parts of each cell side of the given grid.
    steps: splitting steps.
    substeps: of all cells together.
    seconds: for the prediction.
    preparation_seconds: once, for the flow.
    """

    cells: int
    refinement: int
    steps: int
    substeps: int
    seconds: float
    preparation_seconds: float

    def __str__(self) -> str:
        """Return the cost in words."""
        each = self.substeps / (self.steps * self.cells)
        many = self.steps != 1
        split = f', each split into {each:.2g} on average' if each >= SPLIT else ''
        return (
            f'{self.cells:,} cells, {self.steps:,} time step{"s" * many}{split}; '
            f'{"about " if self.seconds >= 1e-3 else ""}{in_words(self.seconds)} for a prediction, '
            f'after {in_words(self.preparation_seconds)} of preparation at the start'
        )


def in_words(seconds: float) -> str:
    """Return a duration in a unit that fits: 0.02 s, 12 s, 3 min, 5 h; or less than 1 ms."""
    minute, hour = 60.0, 3600.0
    if seconds < 1e-3:
        return 'less than 1 ms'
    if seconds < 2 * minute:
        return f'{seconds:.1g} s' if seconds < 10 else f'{seconds:.0f} s'
    if seconds < 2 * hour:
        return f'{seconds / minute:.0f} min'
    return f'{seconds / hour:.0f} h'


def prediction_cost(
    rig: Rig,
    grid: Grid,
    *,
    preset: str = 'fast',
    duration: float,
    rates: WellRates | None = None,
    longest_step: float = LONGEST_STEP,
    slowness: float = 1.0,
) -> PredictionCost:
    """Return the estimated cost of a prediction over `duration` [s].

    Args:
        rig: the rig. Its effects are not counted; those that change the flow cost several times.
        grid: the grid of the maps.
        preset: name of a preset.
        duration: time to predict [s].
        rates: rates of the wells; the largest ones that rig.yaml allows where not given.
        longest_step: longest splitting step [s].
        slowness: time of this machine over the time of the one that the constants stand for.

    Raises:
        InputError: an unknown preset or well.
    """
    chosen = preset_named(preset)
    factor = chosen.refinement(grid)
    fine = grid.refined(factor)
    steps = max(1, math.ceil(duration / longest_step))
    per_second = _cfl_per_second(rig, fine, rates if rates is not None else working_rates(rig))
    cfl = per_second * duration / steps
    levels = np.ceil(np.log2(np.maximum(cfl / CFL_LIMIT, 1.0)))
    cells = fine.nx * fine.nz
    substeps = round(steps * cells * float(np.mean(2.0**levels)))
    each = SECONDS_PER_SUBSTEP[chosen.scheme]
    per_well = (
        SECONDS_PER_FLOW * cells**1.5 if cells <= LARGEST_FACTOR else SECONDS_PER_LARGE_FLOW * cells
    )
    flow = per_well * max(1, len(rig.wells))
    return PredictionCost(
        cells=cells,
        refinement=factor,
        steps=steps,
        substeps=substeps,
        seconds=slowness * (substeps * each + steps * SECONDS_PER_STEP),
        preparation_seconds=slowness * flow,
    )


def working_rates(rig: Rig) -> dict[str, WellRate]:
    """Return the largest rates that rig.yaml allows, or a pore volume in four hours without any."""
    control = rig.control
    if control is None:
        rate = rig.pore_volume / (4 * 3600.0)
        signs = (1.0, -1.0) * len(rig.wells)
        rates = {name: WellRate(sign * rate) for name, sign in zip(rig.wells, signs, strict=False)}
        return rates if len(rates) % 2 == 0 else dict(list(rates.items())[:-1])
    rates = {name: WellRate(from_ml_h(well.rate_ml_h)) for name, well in control.fixed.items()}
    each = from_ml_h(control.max_total_rate_ml_h) / max(1, len(control.wells))
    rates |= {name: WellRate(each) for name in control.wells}
    if control.producer is not None:
        rates[control.producer] = WellRate(-math.fsum(well.rate for well in rates.values()))
    return rates


def slowness_of_this_machine(rig: Rig, preset: str = 'fast') -> float:
    """Return the time of this machine over the estimate, from a trial of about a second."""
    scheme = preset_named(preset).scheme
    grid = _grid_of(rig, TRIAL_CELLS)
    rates = working_rates(rig)
    engine = Engine(nominal_physics(rig, grid), scheme=scheme)
    state = State.equilibrium(np.zeros(grid.shape))
    engine.advance(state, rates, LONGEST_STEP)  # loads the compiled kernels
    start = time.perf_counter()
    engine.advance(state, rates, TRIAL_STEPS * LONGEST_STEP)
    taken = time.perf_counter() - start
    per_second = _cfl_per_second(rig, grid, rates) * LONGEST_STEP
    levels = np.ceil(np.log2(np.maximum(per_second / CFL_LIMIT, 1.0)))
    substeps = grid.nx * grid.nz * float(np.mean(2.0**levels))
    estimated = substeps * SECONDS_PER_SUBSTEP[scheme] + SECONDS_PER_STEP
    return taken / (TRIAL_STEPS * estimated)


def _grid_of(rig: Rig, cells: int) -> Grid:
    """Return a grid of about `cells` square cells."""
    return rig.default_grid(math.sqrt(rig.width_m * rig.height_m / cells))


def _cfl_per_second(rig: Rig, fine: Grid, rates: WellRates) -> FloatArray:
    """Return the CFL number per second [1/s] of the cells of `fine`, seen on a coarse grid."""
    coarse = _grid_of(rig, COARSE_CELLS)
    physics = nominal_physics(rig, coarse)
    if (net := physics.surplus(rates)) != 0.0:  # effects balance it, or the model refuses it
        middle = SourceSink(0.5 * rig.width_m, 0.5 * rig.height_m)
        physics = replace(physics, leaks=(Leak(middle, -net),))
    engine = Engine(physics, scheme=Scheme.UPWIND)
    flux = engine.water_flux(rates)
    x, z = np.abs(flux.x), np.abs(flux.z)
    across = 0.5 * (x[:, :-1] + x[:, 1:]) * coarse.dx / fine.dx
    upward = 0.5 * (z[:-1] + z[1:]) * coarse.dz / fine.dz
    result: FloatArray = (across + upward) / engine.storage
    return result
