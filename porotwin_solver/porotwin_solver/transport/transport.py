"""Advection of the tracer: conservative, bounded, sharp at fronts, with local time steps.

    phi dc/dt + div(q c) = f_c        (paper eq. transport)

Space and time are discretised together, without dimensional splitting. The concentration that
leaves cell i through a face is

    c_f = c_i + correction,    correction = limited slope + transverse part (corner transport)

- Limited slope: Lax-Wendroff with the superbee limiter or the wider one that the CFL number allows,
  or the third-order QUICKEST value kept within the superbee region (LeVeque, Finite Volume Methods
  for Hyperbolic Problems, sec. 6.11; Kemm, Int. J. Numer. Methods Fluids 67 (2011) 404-440;
  Leonard, Comput. Methods Appl. Mech. Eng. 88 (1991) 17-74). Zero for first-order upwind.
- Transverse part: the inflow through the cell's other sides during half a substep (Colella, J.
  Comput. Phys. 87 (1990) 171-200; LeVeque, sec. 20.5).
- Bounds: c_f lies between the two cells of its face. The corrections of one cell are scaled
  together such that the cell stays within the range of itself, its upstream neighbours and the
  injected concentration, as in Zalesak, J. Comput. Phys. 31 (1979) 335-362. Nothing is clipped.

Cells whose concentration cannot change are left out (`awake_cells`).

Local time steps: a cell of level l takes 2^l substeps of dt / 2^l, so that its CFL number is at
most CFL_LIMIT. A face is evaluated at the level of its upstream cell. Both sides receive the same
volume of tracer, so the scheme conserves tracer to round-off.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_solver.coefficients.cell_threads import (
    BLOCK_CELLS,
    THREADED_CELLS,
    in_blocks,
    in_rows,
)
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.transport.awake_cells import (
    ASLEEP,
    AwakeCells,
    ends_with_sources,
    prepare,
    sort_awake,
    spread,
    wake,
)
from porotwin_solver.transport.local_time_steps import (
    NO_TAPE,
    TimeStepLevels,
    assign_levels,
    substeps,
)
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.transport_kernels import (
    advection,
    cfl_rates,
    evaluate_faces,
    phase_count,
    update_cells,
)

CFL_LIMIT = 0.5
"""Largest CFL number [-] of a cell: the fraction of its storage that leaves or enters in one
substep. The bounds hold up to 1, where no room for corrections remains; 0.5 leaves half of it."""


class Sources(NamedTuple):
    """Water and tracer that wells and leaks add to the cells; each (nz, nx) [m^3/s], >= 0.

    inflow: injected water.
    tracer: injected tracer stock, inflow times its concentration.
    outflow: produced water, at the concentration of its cell.
    """

    inflow: FloatArray
    tracer: FloatArray
    outflow: FloatArray

    @property
    def net(self) -> FloatArray:
        """Net injection of water into each cell [m^3/s], (nz, nx)."""
        return self.inflow - self.outflow


class FluxAccumulators(NamedTuple):
    """Work arrays of `advect`, on the faces.

    rate: current tracer flux [m^3/s].
    amount: tracer volume [m^3] that has passed since the cell with the lower level was updated;
        zero between two calls.
    """

    rate: FaceField
    amount: FaceField

    @classmethod
    def zeros(cls, grid: Grid) -> 'FluxAccumulators':
        """Return accumulators for the faces of `grid`."""
        return cls(FaceField.zeros(grid), FaceField.zeros(grid))


class AdvectionTape(NamedTuple):
    """The data of `advect` for its adjoint.

    is_awake: (nz * nx,); the cells that changed.
    count_at_least: (levels,); how many of them have level l or a higher one.
    values: their concentrations [-] before each of their substeps.
    """

    is_awake: NDArray[np.bool_]
    count_at_least: NDArray[np.int64]
    values: FloatArray


def advection_levels(
    flux: FaceField, sources: Sources, storage: FloatArray, duration: float
) -> TimeStepLevels:
    """Return the local time step levels for `flux` and `sources` over `duration` [s].

    `storage` (nz, nx) [m^3] is the volume that stores tracer: rig volume of the cell times porosity
    times retardation factor.
    """
    nz, nx = storage.shape
    rate = np.empty((nz, nx))
    in_rows(cfl_rates, nz, nz * nx, flux, sources, storage, rate)
    level = np.empty((nz, nx), np.int8)
    order, count = assign_levels(rate.ravel(), duration, CFL_LIMIT, level.ravel())
    return TimeStepLevels(duration, level, order, count)


def advect(
    concentration: FloatArray,
    flux: FaceField,
    *,
    sources: Sources,
    storage: FloatArray,
    levels: TimeStepLevels,
    scheme: Scheme,
    accumulators: FluxAccumulators,
    tracer_lost: FloatArray | None = None,
    record: bool = False,
) -> AdvectionTape | None:
    """Advance `concentration` (nz, nx) in place by `levels.duration`.

    The divergence of `flux` must equal `sources.net`. Then a constant concentration stays constant,
    and all values stay within the range of the initial and the injected ones. Water that enters
    through open sides carries no tracer.

    `tracer_lost` (2,) [m^3] grows by the tracer that left: through wells and leaks, through open
    sides. The tape that the adjoint needs is returned if it is to `record` one.
    Threads share the cells of a large grid, unless a tape is recorded.
    """
    lost = np.zeros(2) if tracer_lost is None else tracer_lost
    awake = awake_cells(concentration, flux, sources, storage, levels, accumulators)
    fields: tuple[Any, ...] = (
        concentration,
        flux,
        sources,
        storage,
        levels,
        awake,
        int(scheme),
        accumulators,
        lost,
    )
    phases = 2 << (len(awake.count_at_least) - 1)
    if record:
        tape = np.empty(substeps(awake.count_at_least))
        advection(*fields, tape, 0, phases)
        return AdvectionTape(awake.first_change < ASLEEP, awake.count_at_least, tape)
    if concentration.size < THREADED_CELLS:
        advection(*fields, NO_TAPE, 0, phases)
    else:
        try:
            _advect_in_threads(fields, phases)
        except BaseException:  # Ctrl-C: the sums of a part of a step must not enter the next one
            accumulators.amount.x.fill(0.0)
            accumulators.amount.z.fill(0.0)
            raise
    return None


def _advect_in_threads(fields: tuple[Any, ...], phases: int) -> None:
    """Do as `advection` to its `fields` in all `phases`.

    Threads share a phase of many cells. One call does all phases between two of these.
    """
    concentration, flux, sources, storage, levels, awake, scheme, accumulators, lost = fields
    faces = (concentration, flux, sources, levels, awake, scheme, accumulators)
    cells = (concentration, sources, storage, levels, awake, accumulators)
    begin = 0
    for phase in range(phases):
        count = phase_count(phase, awake.count_at_least)
        if count <= BLOCK_CELLS:
            continue
        advection(*fields, NO_TAPE, begin, phase)
        if phase % 2 == 0:
            in_blocks(evaluate_faces, count, faces)
        else:
            in_blocks(update_cells, count, cells, lost)
        begin = phase + 1
    advection(*fields, NO_TAPE, begin, phases)


def awake_cells(
    concentration: FloatArray,
    flux: FaceField,
    sources: Sources,
    storage: FloatArray,
    levels: TimeStepLevels,
    accumulators: FluxAccumulators,
) -> AwakeCells:
    """Return the cells that `advect` moves; the arguments are its own.

    The `accumulators` get the tracer from the other cells to these.
    """
    rows, size = len(concentration), concentration.size
    first_change = np.empty(size, np.float32)
    ends, extent = np.empty((rows, 2), np.int64), np.empty((rows, 2), np.int64)
    in_rows(ends_with_sources, rows, size, concentration, sources.tracer, ends)
    in_rows(wake, rows, size, concentration, flux, sources, ends, first_change, extent)
    spread(flux, levels.level, first_change, extent)
    highest = len(levels.count_at_least)
    order, count_at_least = sort_awake(first_change, levels.level, extent, highest)
    count = len(order)
    awake = AwakeCells(
        first_change,
        order,
        np.empty(count, np.int32),
        count_at_least,
        np.empty(count),
        np.empty(count, np.int16),
    )
    fields = (concentration, flux, sources, storage, levels, awake, accumulators)
    if size < THREADED_CELLS:
        prepare(*fields, 0, count)
    else:
        in_blocks(prepare, count, fields)
    return awake
