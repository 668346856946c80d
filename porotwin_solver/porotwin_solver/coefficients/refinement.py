"""Interpolation of a map to a finer grid and averaging back: conservative, and sharp at fronts."""

import numpy as np

from porotwin_core.geometry.grid import FloatArray


def refine(field: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return `field` (nz, nx) on a finer grid of `shape`, whole multiples of its own shape.

    Each direction in turn uses limited linear slopes, Roe's superbee, which keep fronts steep
    (LeVeque, Finite Volume Methods for Hyperbolic Problems, sec. 6.9). `coarsen` returns the field
    to round-off. No value leaves the range of a cell and its neighbours.
    """
    rows = _refine_rows(field, shape[0] // field.shape[0])
    return _refine_rows(rows.T, shape[1] // field.shape[1]).T.copy()


def coarsen(field: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return the means of `field` (nz, nx) over the cells of a coarser grid of `shape`."""
    (nz, nx), (rows, columns) = field.shape, shape
    if (nz, nx) == (rows, columns):
        return field.copy()
    return field.reshape(rows, nz // rows, columns, nx // columns).mean(axis=(1, 3))


def coarsen_adjoint(bar: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return dJ/dfield on the fine grid of `shape`, from `bar` = dJ/dmeans of `coarsen`."""
    rows, columns = shape[0] // bar.shape[0], shape[1] // bar.shape[1]
    return np.repeat(np.repeat(bar, rows, axis=0), columns, axis=1) / (rows * columns)


def _refine_rows(field: FloatArray, factor: int) -> FloatArray:
    if factor == 1:
        return field
    padded = np.concatenate([field[:1], field, field[-1:]])
    step = np.diff(padded, axis=0)
    below, above = step[:-1], step[1:]
    low, high = np.minimum(abs(below), abs(above)), np.maximum(abs(below), abs(above))
    slope = np.minimum(2.0 * low, high)
    slope = np.where(below * above > 0, np.sign(above) * slope, 0.0)
    offsets = (np.arange(factor) + 0.5) / factor - 0.5
    fine = field[:, None] + offsets[:, None] * slope[:, None]
    return fine.reshape(-1, *field.shape[1:])
