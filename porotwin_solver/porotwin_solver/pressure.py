"""Solvers for the pressure: a sparse factor, or multigrid on large grids."""

from collections.abc import Callable

from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_solver.multigrid import GridLevel, Multigrid

PressureSolver = Callable[[FloatArray], FloatArray]
"""From the source of every cell [m^3/s] to its pressure [Pa], both flat (nz * nx,)."""

SolverFactory = Callable[[GridLevel], PressureSolver]
"""From the matrix of the pressures to a solver."""

LARGEST_FACTOR = 200_000
"""Cells up to which the matrix is factorised; a factor takes about 1 kB per cell."""

TOLERANCE = 1e-8
"""Relative residual of the iteration. `flow.Flow.flux` solves twice and so reaches round-off."""

MAX_ITERATIONS = 500
"""Fifteen iterations are usual, more where the permeability of neighbours differs by decades."""

COARSEST_CELLS = 20_000
"""Cells of the coarsest grid of the iteration: its factor is used several times in an iteration."""


def pressure_solver(
    level: GridLevel,
    *,
    largest_factor: int = LARGEST_FACTOR,
    max_iterations: int = MAX_ITERATIONS,
) -> PressureSolver:
    """Return a solver for the symmetric positive definite matrix of `level`.

    Up to `largest_factor` cells the matrix is factorised; beyond, `multigrid` iterates, and its
    solver raises InputError where it does not converge.

    Args:
        level: potential [Pa] to net outflow [m^3/s].
        largest_factor: most cells of a matrix that is factorised.
        max_iterations: most iterations of one solution.
    """
    if level.diagonal.size <= largest_factor:
        return factorised(level.matrix())
    coarsest = min(largest_factor, COARSEST_CELLS)
    return multigrid(level, largest_factor=coarsest, max_iterations=max_iterations)


def factorised(matrix: csc_matrix) -> PressureSolver:
    """Return a solver for `matrix` (nz * nx, nz * nx) by sparse LU without pivoting.

    The columns are in minimum-degree order, which suits a symmetric positive definite matrix.
    """
    factor = splu(
        matrix,
        permc_spec='MMD_AT_PLUS_A',
        diag_pivot_thresh=0.0,
        options={'SymmetricMode': True},
    )
    return factor.solve


def multigrid(
    level: GridLevel,
    *,
    largest_factor: int = COARSEST_CELLS,
    max_iterations: int = MAX_ITERATIONS,
) -> PressureSolver:
    """Return a solver by conjugate gradients with `Multigrid`, for matrices too large to factorise.

    The solver raises InputError when it does not converge within `max_iterations`.
    """
    cycles = Multigrid(level, factorised, largest_factor=largest_factor)

    def solve(source: FloatArray) -> FloatArray:
        pressure = cycles.solve(
            source.reshape(level.shape), tolerance=TOLERANCE, most_iterations=max_iterations
        )
        if pressure is None:
            rows, columns = level.shape
            raise InputError(
                f'pressure on {columns} x {rows} cells: no convergence in {max_iterations} '
                'iterations; the permeability varies too much for so fine a grid, make it coarser'
            )
        return pressure.ravel()

    return solve
