"""Solvers for the pressure: a sparse factor, or for large grids an iteration on two grids."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray

PressureSolver = Callable[[FloatArray], FloatArray]
"""From the source of every cell [m^3/s] to its pressure [Pa], both flat (nz * nx,)."""

SolverFactory = Callable[[csc_matrix, tuple[int, int]], PressureSolver]
"""From the pressure matrix and the shape (nz, nx) of the grid to a solver."""

LARGEST_FACTOR = 200_000
"""Cells up to which the matrix itself is factorised; a factor takes about 1 kB per cell."""

TOLERANCE = 1e-9
"""Relative residual of the iteration. `flow.Flow.flux` solves twice and so reaches round-off."""

MAX_ITERATIONS = 500
"""Ten iterations are usual, 50 where the permeability of neighbours differs by decades."""

JACOBI_DAMPING = 0.7
"""Damping [-] of the Jacobi smoother; it damps the upper half of the five-point spectrum most."""

OVERCORRECTION = 1.8
"""Factor [-] of the coarse correction: constant blocks are too stiff by about a factor of two."""


def pressure_solver(
    matrix: csc_matrix,
    shape: tuple[int, int],
    *,
    largest_factor: int = LARGEST_FACTOR,
    max_iterations: int = MAX_ITERATIONS,
) -> PressureSolver:
    """Return a solver for the symmetric positive definite `matrix` of (nz, nx) = `shape` cells.

    Up to `largest_factor` cells the matrix is factorised; beyond, `two_grid` iterates, and its
    solver raises InputError where it does not converge.

    Args:
        matrix: potential [Pa] to net outflow [m^3/s], (nz * nx, nz * nx).
        shape: (nz, nx).
        largest_factor: most cells of a matrix that is factorised.
        max_iterations: most iterations of one solution.
    """
    if matrix.shape[0] <= largest_factor:
        return factorised(matrix)
    return two_grid(matrix, shape, largest_factor=largest_factor, max_iterations=max_iterations)


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


def two_grid(
    matrix: csc_matrix,
    shape: tuple[int, int],
    *,
    largest_factor: int = LARGEST_FACTOR,
    max_iterations: int = MAX_ITERATIONS,
) -> PressureSolver:
    """Return a solver by preconditioned conjugate gradients, for matrices too large to factorise.

    The preconditioner smooths by damped Jacobi before and after a correction on 2 x 2 blocks of
    cells, whose matrix is factorised. The correction is scaled up because blocks of constant
    pressure are too stiff (Braess, Computing 55 (1995) 379-393).

    The solver raises InputError when it does not converge within `max_iterations`.
    """
    rows, columns = np.indices(shape)
    coarse_columns = (shape[1] + 1) // 2
    block = ((rows // 2) * coarse_columns + columns // 2).ravel()
    cells = np.arange(block.size)
    spread = csc_matrix((np.ones(block.size), (cells, block)))
    solve_blocks = pressure_solver(
        csc_matrix(spread.T @ matrix @ spread),
        ((shape[0] + 1) // 2, coarse_columns),
        largest_factor=largest_factor,
        max_iterations=max_iterations,
    )
    damped = JACOBI_DAMPING / matrix.diagonal()

    def preconditioned(residual: FloatArray) -> FloatArray:
        pressure = damped * residual
        pressure += damped * (residual - matrix @ pressure)
        coarse = solve_blocks(spread.T @ (residual - matrix @ pressure))
        pressure += OVERCORRECTION * coarse[block]
        for _ in range(2):
            pressure += damped * (residual - matrix @ pressure)
        return pressure

    def solve(source: FloatArray) -> FloatArray:
        pressure, unconverged = cg(
            matrix,
            source,
            rtol=TOLERANCE,
            maxiter=max_iterations,
            M=LinearOperator(matrix.shape, matvec=preconditioned, dtype=float),
        )
        if unconverged:
            raise InputError(
                f'pressure on {shape[1]} x {shape[0]} cells: no convergence in {max_iterations} '
                'iterations; the permeability varies too much for so fine a grid, make it coarser'
            )
        return np.asarray(pressure)

    return solve
