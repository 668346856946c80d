"""Compiled kernels of `multigrid`; each works on the rows `first` to `last - 1`.

Arguments that recur: `p` potential with a frame of zeros, (nz + 2, nx + 2); `b` source (nz, nx);
`x` and `z` transmissibilities of the faces, (nz, nx + 1) and (nz + 1, nx), zero on all sides of the
rig; `diagonal` and `inverse` (nz, nx), the diagonal of the matrix and one divided by it. The frame
spares the question whether a cell has a neighbour.
"""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.coefficients.compiled import compiled


@compiled
def neighbours(p, x, z, i, j):
    """Return the part of the neighbours in the row of cell (i, j) of the matrix, with plus sign."""
    return (
        x[i, j] * p[i + 1, j]
        + x[i, j + 1] * p[i + 1, j + 2]
        + z[i, j] * p[i, j + 1]
        + z[i + 1, j] * p[i + 2, j + 1]
    )


@compiled
def begin(p, b, inverse, first, last):
    """Solve the equations of the even cells of a chessboard, with zero in all others."""
    for i in range(first, last):
        for j in range(i % 2, b.shape[1], 2):
            p[i + 1, j + 1] = b[i, j] * inverse[i, j]


@compiled
def relax(p, b, x, z, inverse, colour, first, last):
    """Solve the equations of the cells of one `colour` of a chessboard, 0 or 1, in place."""
    for i in range(first, last):
        for j in range((i + colour) % 2, b.shape[1], 2):
            p[i + 1, j + 1] = (b[i, j] + neighbours(p, x, z, i, j)) * inverse[i, j]


@compiled
def outflow(p, x, z, diagonal, result, first, last):
    """Fill `result` (nz, nx) with the matrix times `p`."""
    for i in range(first, last):
        for j in range(result.shape[1]):
            result[i, j] = diagonal[i, j] * p[i + 1, j + 1] - neighbours(p, x, z, i, j)


@compiled
def restricted(p, b, x, z, diagonal, coarse, first, last):
    """Fill rows of `coarse` with the sums of the residual over blocks of 2 x 2 cells."""
    nz, nx = b.shape
    for row in range(first, last):
        for column in range(coarse.shape[1]):
            total = 0.0
            for i in range(2 * row, min(2 * row + 2, nz)):
                for j in range(2 * column, min(2 * column + 2, nx)):
                    here = diagonal[i, j] * p[i + 1, j + 1]
                    total += b[i, j] - here + neighbours(p, x, z, i, j)
            coarse[row, column] = total


@compiled
def prolonged(p, coarse, first, last):
    """Add to every cell of `p` the potential of its block in `coarse`, which has a frame too."""
    for i in range(first, last):
        for j in range(p.shape[1] - 2):
            p[i + 1, j + 1] += coarse[i // 2 + 1, j // 2 + 1]


@compiled
def products(p, b, sums, first, last):
    """Fill `sums` (nz,) with the scalar products of the rows of a framed field and another."""
    for i in range(first, last):
        total = 0.0
        for j in range(b.shape[1]):
            total += p[i + 1, j + 1] * b[i, j]
        sums[i] = total


@compiled
def squares(b, sums, first, last):
    """Fill `sums` (nz,) with the sums of squares of the rows of `b`."""
    for i in range(first, last):
        total = 0.0
        for j in range(b.shape[1]):
            total += b[i, j] * b[i, j]
        sums[i] = total


@compiled
def add(values, factor, direction, first, last):
    """Add `factor` times `direction` to `values`, both with a frame or both without."""
    for i in range(first, last):
        for j in range(values.shape[1]):
            values[i, j] += factor * direction[i, j]


@compiled
def turn(values, factor, gradient, first, last):
    """Replace `values` by `gradient` plus `factor` times themselves."""
    for i in range(first, last):
        for j in range(values.shape[1]):
            values[i, j] = gradient[i, j] + factor * values[i, j]


@compiled
def conjugate_step(p, residual, direction, carried, gradient, x, z, diagonal, energy):
    """Make one step of conjugate gradients in place, on all rows.

    `carried` is the matrix times the last `direction`, `energy` their product. Returns the new
    product, and the sum of squares of the new residual.
    """
    rows = len(residual)
    sums = np.empty(rows)
    products(gradient, carried, sums, 0, rows)
    turn(direction, -np.sum(sums) / energy, gradient, 0, rows + 2)
    outflow(direction, x, z, diagonal, carried, 0, rows)
    products(direction, carried, sums, 0, rows)
    energy = np.sum(sums)
    products(direction, residual, sums, 0, rows)
    step = np.sum(sums) / energy
    add(p, step, direction, 0, rows + 2)
    add(residual, -step, carried, 0, rows)
    squares(residual, sums, 0, rows)
    return energy, np.sum(sums)
