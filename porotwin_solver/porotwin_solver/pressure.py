"""Solvers for the pressure: by the factor of its matrix, or of one with a quarter of the rows."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray

PressureSolver = Callable[[FloatArray], FloatArray]
"""From the source of every cell to its pressure, both flat."""

LARGEST_FACTOR = 200_000
"""Cells up to which the matrix itself is factorised; a factor takes about 1 kB per cell."""

TOLERANCE = 1e-9
"""Relative residual of the iteration; `flow.Flow.flux` solves twice and ends at round-off."""

MOST_ITERATIONS = 500
"""Ten are usual, 50 where the permeability of neighbours differs by decades."""


def pressure_solver(matrix: csc_matrix, shape: tuple[int, int]) -> PressureSolver:
    """Return a solver for the symmetric positive definite `matrix` of cells (nz, nx) = `shape`."""
    if matrix.shape[0] <= LARGEST_FACTOR:
        return factorised(matrix)
    return two_grid(matrix, shape)


def factorised(matrix: csc_matrix) -> PressureSolver:
    """Return a solver by sparse LU without pivoting, columns in minimum-degree order."""
    factor = splu(
        matrix,
        permc_spec='MMD_AT_PLUS_A',
        diag_pivot_thresh=0.0,
        options={'SymmetricMode': True},
    )
    return factor.solve


def two_grid(matrix: csc_matrix, shape: tuple[int, int]) -> PressureSolver:
    """Return a solver by conjugate gradients with two grids: for matrices too large to factorise.

    The preconditioner smooths by damped Jacobi before and after a correction on 2 x 2 blocks of
    cells, whose matrix is factorised. Blocks of constant pressure are too stiff by about a factor
    of two, which the correction makes up for (Braess, Computing 55 (1995) 379-393).

    The solver raises InputError where the iteration does not get there.
    """
    rows, columns = np.indices(shape)
    coarse_columns = (shape[1] + 1) // 2
    block = ((rows // 2) * coarse_columns + columns // 2).ravel()
    cells = np.arange(block.size)
    spread = csc_matrix((np.ones(block.size), (cells, block)))
    solve_blocks = pressure_solver(
        csc_matrix(spread.T @ matrix @ spread), ((shape[0] + 1) // 2, coarse_columns)
    )
    damped = 0.7 / matrix.diagonal()

    def smoothed(residual: FloatArray) -> FloatArray:
        pressure = damped * residual
        pressure += damped * (residual - matrix @ pressure)
        pressure += 1.8 * solve_blocks(spread.T @ (residual - matrix @ pressure))[block]
        for _ in range(2):
            pressure += damped * (residual - matrix @ pressure)
        return pressure

    def solve(source: FloatArray) -> FloatArray:
        pressure, unfinished = cg(
            matrix,
            source,
            rtol=TOLERANCE,
            maxiter=MOST_ITERATIONS,
            M=LinearOperator(matrix.shape, matvec=smoothed, dtype=float),
        )
        if unfinished:
            raise InputError(
                f'pressure on {shape[1]} x {shape[0]} cells: not found in {MOST_ITERATIONS} '
                'iterations; the permeability varies too much for so fine a grid, make it coarser'
            )
        return np.asarray(pressure)

    return solve
