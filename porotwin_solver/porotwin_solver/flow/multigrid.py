"""Multigrid for the pressure on grids that are too large for a factor.

Conjugate gradients are preconditioned by a cycle over grids whose cells are blocks of 2 x 2 cells
of the finer one. The potential is constant in a block, so the transmissibilities of fine faces add
up to the one of their coarse face, and every coarse matrix is a two-point matrix again. Blocks of
constant potential are too stiff. The K-cycle corrects that: on each coarse grid it makes two steps
of conjugate gradients, whose lengths fit any permeability (Notay and Vassilevski, Numer. Linear
Algebra Appl. 15 (2008) 473-487). The smoother is Gauss-Seidel on a chessboard. The coarsest matrix
is factorised. A level takes 48 B per cell.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.cell_threads import THREADED_CELLS, in_rows
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.flow import multigrid_kernels as kernels

Solve = Callable[[FloatArray], FloatArray]

ENOUGH = 0.25
"""Residual of the first inner step [-] that makes a second one useless (Notay and Vassilevski)."""


@dataclass(frozen=True)
class GridLevel:
    """The two-point matrix of one grid; potentials have a frame of zeros, (nz + 2, nx + 2).

    Attributes:
        trans: transmissibilities of the faces [m^3/(s Pa)]; zero on all sides of the rig.
        diagonal: of the matrix, (nz, nx); it includes the open sides.
    """

    trans: FaceField
    diagonal: FloatArray

    @classmethod
    def of(
        cls, trans: FaceField, *, pin: float, canal: NDArray[np.bool_] | None = None
    ) -> 'GridLevel':
        """Return the symmetric positive definite matrix of the pressures.

        `trans` [m^3/(s Pa)] includes the open sides. `pin` is added to the first diagonal entry. In
        a rig without open sides the pressure is known up to a constant; the pin fixes it, and with
        balanced sources it changes no flux. The cells of `canal` (nz, nx) have the potential zero,
        for sources that are zero there.
        """
        x, z = trans
        diagonal = x[:, :-1] + x[:, 1:] + z[:-1] + z[1:]
        diagonal[0, 0] += pin
        inner = FaceField(x.copy(), z.copy())
        inner.x[:, [0, -1]] = 0.0
        inner.z[[0, -1]] = 0.0
        if canal is not None:
            inner.x[:, 1:-1][canal[:, :-1] | canal[:, 1:]] = 0.0
            inner.z[1:-1][canal[:-1] | canal[1:]] = 0.0
            diagonal[canal] = diagonal.max()
        return cls(inner, diagonal)

    @property
    def shape(self) -> tuple[int, int]:
        """(nz, nx)."""
        nz, nx = self.diagonal.shape
        return nz, nx

    @cached_property
    def inverse(self) -> FloatArray:
        """One divided by the diagonal, (nz, nx)."""
        return 1.0 / self.diagonal

    def matrix(self) -> csc_matrix:
        """Return the matrix, (nz * nx, nz * nx)."""
        nz, nx = self.shape
        right, up = self.trans.x[:, 1:].ravel()[:-1], self.trans.z[1:-1].ravel()
        lines = {0: self.diagonal.ravel(), 1: -right, -1: -right}
        if nz > 1:  # of one column, the neighbour above is the next cell
            lines |= {nx: lines.get(nx, 0.0) - up, -nx: lines.get(-nx, 0.0) - up}
        return csc_matrix(diags(list(lines.values()), offsets=list(lines), shape=(nz * nx,) * 2))

    def coarser(self) -> 'GridLevel':
        """Return the matrix of the blocks of 2 x 2 cells; the last ones may have fewer."""
        nz, nx = self.shape
        rows, columns = np.arange(0, nz, 2), np.arange(0, nx, 2)
        x = np.zeros((len(rows), len(columns) + 1))
        z = np.zeros((len(rows) + 1, len(columns)))
        x[:, 1:-1] = np.add.reduceat(self.trans.x[:, columns[1:]], rows, axis=0)
        z[1:-1] = np.add.reduceat(self.trans.z[rows[1:]], columns, axis=1)
        # faces within a block carry nothing out of it
        outer = self.diagonal.copy()
        outer[:, :-1:2] -= 2.0 * self.trans.x[:, 1:-1:2]
        outer[:-1:2] -= 2.0 * self.trans.z[1:-1:2]
        diagonal = np.add.reduceat(np.add.reduceat(outer, rows, axis=0), columns, axis=1)
        return GridLevel(FaceField(x, z), diagonal)

    def potential(self) -> FloatArray:
        """Return a potential of zero."""
        nz, nx = self.shape
        return np.zeros((nz + 2, nx + 2))

    def outflow(self, p: FloatArray) -> FloatArray:
        """Return the matrix times the potential `p`, (nz, nx)."""
        result = np.empty(self.shape)
        self._rows(kernels.outflow, p, *self.trans, self.diagonal, result)
        return result

    def block_residuals(self, p: FloatArray, b: FloatArray, coarse: 'GridLevel') -> FloatArray:
        """Return the residual after one relaxation from zero for the source `b`, of each block.

        The potential `p` is used as a work array.
        """
        result = np.empty(coarse.shape)
        where = (p, b, *self.trans, self.inverse, result)
        in_rows(kernels.restricted, len(result), self.diagonal.size, *where)
        return result

    def smoothed(self, p: FloatArray, b: FloatArray, correction: FloatArray) -> FloatArray:
        """Return the potential of `block_residuals` after the `correction` and a relaxation."""
        result = self.potential()
        self._rows(kernels.smoothed, p, b, *self.trans, self.inverse, correction, result)
        return result

    def carried(self, p: FloatArray, b: FloatArray, out: FloatArray) -> tuple[float, float]:
        """Fill `out` (nz, nx) with the matrix times `p`; return `p` times it, and `p` times `b`."""
        sums = np.empty((self.shape[0], 2))
        self._rows(kernels.carry, p, b, *self.trans, self.diagonal, out, sums)
        energy, work = sums.sum(axis=0).tolist()
        return energy, work

    def reduced(self, residual: FloatArray, step: float, carried: FloatArray) -> float:
        """Take `step` times `carried` from `residual`; return the sum of its squares."""
        sums = np.empty(self.shape[0])
        self._rows(kernels.reduce, residual, step, carried, sums)
        return float(np.sum(sums))

    def product(self, p: FloatArray, b: FloatArray) -> float:
        """Return the scalar product of a potential and a source."""
        sums = np.empty(self.shape[0])
        self._rows(kernels.products, p, b, sums)
        return float(np.sum(sums))

    def square(self, b: FloatArray) -> float:
        """Return the sum of the squares of a source."""
        sums = np.empty(self.shape[0])
        self._rows(kernels.squares, b, sums)
        return float(np.sum(sums))

    def conjugate_step(
        self,
        p: FloatArray,
        residual: FloatArray,
        direction: FloatArray,
        carried: FloatArray,
        gradient: FloatArray,
        energy: float,
    ) -> tuple[float, float]:
        """Move the potential `p` along the conjugate of the preconditioned residual `gradient`.

        All fields change in place: `carried` is the matrix times the last `direction`, and `energy`
        the product of the two. Returns their new product, and the sum of squares of the residual.
        """
        if self.diagonal.size < THREADED_CELLS:
            fields = (p, residual, direction, carried, gradient, *self.trans, self.diagonal)
            found: tuple[float, float] = kernels.conjugate_step(*fields, energy)
            return found
        _add_rows(kernels.turn, direction, -self.product(gradient, carried) / energy, gradient)
        energy, work = self.carried(direction, residual, carried)
        step = work / energy
        _add_rows(kernels.add, p, step, direction)
        return energy, self.reduced(residual, step, carried)

    def _rows(self, kernel: Callable[..., None], *args: object) -> None:
        in_rows(kernel, self.shape[0], self.diagonal.size, *args)


class Multigrid:
    """Solver for one two-point matrix; it may serve several threads at once."""

    def __init__(
        self, finest: GridLevel, factorise: Callable[[csc_matrix], Solve], *, largest_factor: int
    ) -> None:
        """Prepare the coarse grids of `finest`, and `factorise` the matrix of the last one.

        That one has at most `largest_factor` cells.
        """
        self._levels = [finest]
        while self._levels[-1].diagonal.size > largest_factor:
            self._levels.append(self._levels[-1].coarser())
        self._solve_coarsest = factorise(self._levels[-1].matrix())

    def solve(
        self,
        source: FloatArray,
        *,
        begin: FloatArray | None = None,
        tolerance: float,
        most_iterations: int,
    ) -> FloatArray | None:
        """Return the potential (nz, nx) [Pa] for `source` (nz, nx) [m^3/s].

        The arguments have the meaning of `conjugate_gradients`.
        """
        return conjugate_gradients(
            self._levels[0],
            source,
            partial(self._cycle, 0),
            begin=begin,
            tolerance=tolerance,
            most_iterations=most_iterations,
        )

    def _cycle(self, number: int, b: FloatArray) -> FloatArray:
        """Return an approximate potential for the source `b` on the grid `number`."""
        level = self._levels[number]
        if number == len(self._levels) - 1:
            exact = level.potential()
            exact[1:-1, 1:-1] = self._solve_coarsest(b.ravel()).reshape(level.shape)
            return exact
        p, coarse = level.potential(), self._levels[number + 1]
        correction = self._inner(number + 1, level.block_residuals(p, b, coarse))
        return level.smoothed(p, b, correction)

    def _inner(self, number: int, b: FloatArray) -> FloatArray:
        """Return the result of at most two steps of conjugate gradients on the grid `number`."""
        level = self._levels[number]
        first = self._cycle(number, b)
        if number == len(self._levels) - 1:
            return first
        first_out, left = np.empty(level.shape), b.copy()
        first_energy, work = level.carried(first, b, first_out)
        step = work / first_energy if first_energy > 0.0 else 0.0
        if level.reduced(left, step, first_out) <= ENOUGH**2 * level.square(b):
            first *= step
            return first
        second, second_out = self._cycle(number, left), np.empty(level.shape)
        common = level.product(second, first_out)
        second_energy, work = level.carried(second, left, second_out)
        energy = second_energy - common**2 / first_energy
        second_step = work / energy
        first *= step - common * second_step / first_energy
        _add_rows(kernels.add, first, second_step, second)
        return first


def conjugate_gradients(
    level: GridLevel,
    source: FloatArray,
    precondition: Solve,
    *,
    begin: FloatArray | None = None,
    tolerance: float,
    most_iterations: int,
) -> FloatArray | None:
    """Return the potential (nz, nx) [Pa] of the matrix `level` for `source` (nz, nx) [m^3/s].

    `precondition` returns an approximate potential with a frame for a source (nz, nx). `begin` is a
    first guess of the potential (nz, nx) [Pa]; zero by default. None if the norm of the residual
    still exceeds `tolerance` times the norm of the source after `most_iterations`. The conjugate
    gradients are flexible ones, because the preconditioner may vary from step to step (Notay, SIAM
    J. Sci. Comput. 22 (2000) 1444).
    """
    p, direction = level.potential(), level.potential()
    residual, carried = source.copy(), np.zeros(level.shape)
    square = level.square(source)
    wanted, energy = tolerance**2 * square, 1.0
    if begin is not None:
        p[1:-1, 1:-1] = begin
        residual -= level.outflow(p)
        square = level.square(residual)
    for _ in range(most_iterations):
        if square <= wanted:
            return p[1:-1, 1:-1]
        gradient = precondition(residual)
        energy, square = level.conjugate_step(p, residual, direction, carried, gradient, energy)
    return None


def _add_rows(kernel: Callable[..., None], values: FloatArray, *args: object) -> None:
    in_rows(kernel, len(values), values.size, values, *args)
