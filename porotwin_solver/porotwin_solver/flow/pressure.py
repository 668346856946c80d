"""The pressures of one matrix: by a sparse factor, or by multigrid.

A factor takes as long as ten to thirty iterated solutions, and then solves four times as fast. So a
matrix is factorised only if the flow is solved at every step. The unit flows of a few wells
are iterated.
"""

from functools import cached_property
from threading import Lock

from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.flow.multigrid import GridLevel, Multigrid, Solve

QUICK_FACTOR = 1_000_000
"""Cells times those along the shorter side, up to which a factor takes as long as a few iterated
solutions. The factor of a long and narrow grid is quick."""

LARGEST_FACTOR = 200_000
"""Cells up to which the matrix may be factorised; a factor takes about 1 kB per cell."""

TOLERANCE = 1e-8
"""Relative residual of the iteration. `flow.Flow.flux` solves twice and so reaches round-off."""

MAX_ITERATIONS = 1000
"""Fifteen iterations are usual, more where the permeability of neighbours differs by decades."""

WORTHWHILE_ITERATIONS = 40
"""Iterations that take as long as a factor, which is made if they do not suffice."""

COARSEST_CELLS = 5_000
"""Cells of the coarsest grid of the iteration: its factor is used several times in an iteration."""


class Pressures:
    """Solver for the symmetric positive definite matrix of `level`; it may serve several threads.

    Args:
        level: potential [Pa] to net outflow [m^3/s].
        quick_factor: cells times those along the shorter side up to which the matrix is factorised
            even for a single solution.
        largest_factor: most cells of a matrix that is ever factorised.
        max_iterations: most iterations of one solution on larger grids.
    """

    def __init__(
        self,
        level: GridLevel,
        *,
        quick_factor: int = QUICK_FACTOR,
        largest_factor: int = LARGEST_FACTOR,
        max_iterations: int = MAX_ITERATIONS,
    ) -> None:
        """Prepare nothing yet: the factor and the coarse grids are made when they are needed."""
        self._level = level
        self._quick_factor = quick_factor
        self._largest_factor = largest_factor
        self._max_iterations = max_iterations
        self._lock = Lock()

    def solve(self, source: FloatArray) -> FloatArray:
        """Return the pressure of every cell [Pa] for its `source` [m^3/s], both flat (nz * nx,).

        Use it where the matrix has many sources: the first call factorises it.

        Raises:
            InputError: the grid is too large for a factor, and the iteration does not converge.
        """
        if self._level.diagonal.size <= self._largest_factor:
            return self._by_factor(source)
        pressure = self._iterated(source, self._max_iterations)
        if pressure is None:
            rows, columns = self._level.shape
            raise InputError(
                f'pressure on {columns} x {rows} cells: no convergence in {self._max_iterations} '
                'iterations; the permeability varies too much for so fine a grid, or the cells are '
                'long and thin: make it coarser, with cells as wide as high'
            )
        return pressure

    def solve_once(self, source: FloatArray) -> FloatArray:
        """Return the same as `solve`, without a factor on grids where that would take longer.

        Raises:
            InputError: as `solve`.
        """
        cells = self._level.diagonal.size
        work = cells * min(self._level.shape)
        if work > self._quick_factor and cells <= self._largest_factor:
            pressure = self._iterated(source, WORTHWHILE_ITERATIONS)
            if pressure is not None:
                return pressure
        return self.solve(source)

    def _iterated(self, source: FloatArray, most_iterations: int) -> FloatArray | None:
        with self._lock:
            cycles = self._cycles
        pressure = cycles.solve(
            source.reshape(self._level.shape), tolerance=TOLERANCE, most_iterations=most_iterations
        )
        return None if pressure is None else pressure.ravel()

    def _by_factor(self, source: FloatArray) -> FloatArray:
        with self._lock:
            solve = self._factor
        return solve(source)

    @cached_property
    def _factor(self) -> Solve:
        return factorised(self._level.matrix())

    @cached_property
    def _cycles(self) -> Multigrid:
        coarsest = min(self._largest_factor, COARSEST_CELLS)
        return Multigrid(self._level, factorised, largest_factor=coarsest)


def factorised(matrix: csc_matrix) -> Solve:
    """Return a solver for `matrix` (nz * nx, nz * nx) by sparse LU without pivoting.

    The columns are in minimum-degree order, which suits a symmetric positive definite matrix.
    """
    factor = splu(
        matrix,
        permc_spec='MMD_AT_PLUS_A',
        diag_pivot_thresh=0.0,
        options={'SymmetricMode': True},
    )
    solve: Solve = factor.solve
    return solve
