"""Numbers on the faces of a grid, such as fluxes and transmissibilities."""

from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_solver.coefficients.compiled import compiled


class FaceField(NamedTuple):
    """One number per face: `x` (nz, nx + 1) on vertical faces, `z` (nz + 1, nx) on horizontal ones.

    A flux is a volume per time [m^3/s], positive to the right and upward. `+` and `*` act on every
    face, as they do for arrays. A named tuple, so that compiled kernels take it as one argument.
    """

    x: FloatArray
    z: FloatArray

    @classmethod
    def zeros(cls, grid: Grid) -> 'FaceField':
        """Return zeros on every face of `grid`."""
        return cls(np.zeros((grid.nz, grid.nx + 1)), np.zeros((grid.nz + 1, grid.nx)))

    def __add__(self, other: 'FaceField') -> 'FaceField':  # type: ignore[override]
        return FaceField(self.x + other.x, self.z + other.z)

    def __mul__(self, factor: 'float | FaceField') -> 'FaceField':  # type: ignore[override]
        if isinstance(factor, FaceField):
            return FaceField(self.x * factor.x, self.z * factor.z)
        return FaceField(self.x * factor, self.z * factor)

    def refined(self, factor: int) -> 'FaceField':
        """Return the flux through the faces of cells divided into `factor` x `factor` parts.

        The velocity varies linearly across a cell (lowest-order Raviart-Thomas element), so the
        parts of a cell share its divergence equally.
        """
        if factor == 1:
            return self
        return FaceField(
            np.repeat(_interpolated(self.x.T, factor).T, factor, axis=0) / factor,
            np.repeat(_interpolated(self.z, factor), factor, axis=1) / factor,
        )

    def refined_adjoint(self, factor: int) -> 'FaceField':
        """Return the transpose of `refined`, applied to derivatives on the fine faces."""
        if factor == 1:
            return self
        return FaceField(
            _interpolated_adjoint(_sums(self.x, factor).T, factor).T / factor,
            _interpolated_adjoint(_sums(self.z.T, factor).T, factor) / factor,
        )

    def divergence(self) -> FloatArray:
        """Return the net outflow of every cell, (nz, nx)."""
        # slices: np.diff takes three times as long on a small grid
        outflow: FloatArray = self.x[:, 1:] - self.x[:, :-1]
        outflow += self.z[1:] - self.z[:-1]
        return outflow


def _interpolated(rows: FloatArray, factor: int) -> FloatArray:
    """Return `rows` with `factor` - 1 linearly interpolated rows between neighbours."""
    parts = np.arange(factor)[:, None] / factor
    between = rows[:-1, None] * (1.0 - parts) + rows[1:, None] * parts
    return np.concatenate([between.reshape(-1, rows.shape[1]), rows[-1:]])


def _interpolated_adjoint(rows: FloatArray, factor: int) -> FloatArray:
    """Return the transpose of `_interpolated`, applied to `rows`."""
    parts = np.arange(factor)[:, None] / factor
    between = rows[:-1].reshape(-1, factor, rows.shape[1])
    coarse = np.zeros((len(between) + 1, rows.shape[1]))
    coarse[:-1] += (between * (1.0 - parts)).sum(axis=1)
    coarse[1:] += (between * parts).sum(axis=1)
    coarse[-1] += rows[-1]
    return coarse


def _sums(rows: FloatArray, factor: int) -> FloatArray:
    """Return the sum of every `factor` consecutive rows."""
    return rows.reshape(-1, factor, rows.shape[1]).sum(axis=1)


@compiled
def weighted_sum(weights, fields):  # type: ignore[no-untyped-def]
    """Return the sum of weight times field over the first axis of `fields` (count, rows, columns).

    Not np.dot: its threads wait for each other, which takes longer than the sum.
    """
    _, rows, columns = fields.shape
    total = np.zeros((rows, columns))
    for i in range(rows):
        for n in range(len(weights)):
            if weights[n] != 0.0:
                for j in range(columns):
                    total[i, j] += weights[n] * fields[n, i, j]
    return total
