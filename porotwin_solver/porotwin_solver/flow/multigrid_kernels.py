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
def begin_row(p, b, inverse, i):
    """Solve the equations of the even cells of row `i`, with zero in all others."""
    for j in range(i % 2, b.shape[1], 2):
        p[i + 1, j + 1] = b[i, j] * inverse[i, j]


@compiled
def relax_row(p, b, x, z, inverse, colour, i, result):
    """Solve the equations of the cells of one `colour` in row `i`, 0 or 1, into `result`."""
    for j in range((i + colour) % 2, b.shape[1], 2):
        result[i + 1, j + 1] = (b[i, j] + neighbours(p, x, z, i, j)) * inverse[i, j]


@compiled
def restricted(p, b, x, z, inverse, coarse, first, last):
    """Relax even and odd cells from zero, and sum the residual over blocks of 2 x 2 cells.

    `first` and `last` count rows of `coarse`. Odd cells have no residual. The residual of an even
    cell is the part of its neighbours. This range computes the first rows of the next one too, with
    the same result.
    """
    nz = len(b)
    begun, relaxed = max(2 * first - 2, 0), max(2 * first - 1, 0)
    for row in range(first, last):
        for i in range(begun, min(2 * row + 4, nz)):
            begin_row(p, b, inverse, i)
        begun = min(2 * row + 4, nz)
        for i in range(relaxed, min(2 * row + 3, nz)):
            relax_row(p, b, x, z, inverse, 1, i, p)
        relaxed = min(2 * row + 3, nz)
        for column in range(coarse.shape[1]):
            coarse[row, column] = 0.0
        for i in range(2 * row, min(2 * row + 2, nz)):
            for j in range(i % 2, b.shape[1], 2):
                coarse[row, j // 2] += neighbours(p, x, z, i, j)


@compiled
def prolong_row(p, b, inverse, coarse, i):
    """Set the even cells of row `i` as `begin_row`, and add the potential of their block."""
    for j in range(i % 2, b.shape[1], 2):
        p[i + 1, j + 1] = b[i, j] * inverse[i, j] + coarse[i // 2 + 1, j // 2 + 1]


@compiled
def smoothed(p, b, x, z, inverse, coarse, result, first, last):
    """Fill rows of `result` with the potential after `coarse`, relaxed at odd and at even cells.

    This is the opposite order of `restricted`: so the cycle is symmetric. Earlier values of odd
    cells have no effect. `p` holds values in between. This range computes some rows of its
    neighbours too, with the same result.
    """
    nz = len(b)
    begun, relaxed = max(first - 2, 0), max(first - 1, 0)
    for row in range(first, last):
        for i in range(begun, min(row + 3, nz)):
            prolong_row(p, b, inverse, coarse, i)
        begun = min(row + 3, nz)
        for i in range(relaxed, min(row + 2, nz)):
            relax_row(p, b, x, z, inverse, 1, i, p)
        relaxed = min(row + 2, nz)
        relax_row(p, b, x, z, inverse, 0, row, result)
        for j in range((row + 1) % 2, b.shape[1], 2):
            result[row + 1, j + 1] = p[row + 1, j + 1]


@compiled
def outflow(p, x, z, diagonal, result, first, last):
    """Fill `result` (nz, nx) with the matrix times `p`."""
    for i in range(first, last):
        for j in range(result.shape[1]):
            result[i, j] = diagonal[i, j] * p[i + 1, j + 1] - neighbours(p, x, z, i, j)


@compiled
def carry(p, b, x, z, diagonal, result, sums, first, last):
    """Fill `result` as `outflow`, and `sums` (nz, 2) with the products of `p` with it and `b`."""
    for i in range(first, last):
        energy, work = 0.0, 0.0
        for j in range(result.shape[1]):
            here = p[i + 1, j + 1]
            carried = diagonal[i, j] * here - neighbours(p, x, z, i, j)
            result[i, j] = carried
            energy += here * carried
            work += here * b[i, j]
        sums[i, 0], sums[i, 1] = energy, work


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
    """Add `factor` times `direction` to `values`, both with a frame."""
    for i in range(first, last):
        for j in range(values.shape[1]):
            values[i, j] += factor * direction[i, j]


@compiled
def reduce(residual, factor, carried, sums, first, last):
    """Take `factor` times `carried` from `residual`; `sums` (nz,) gets its squares, row by row."""
    for i in range(first, last):
        total = 0.0
        for j in range(residual.shape[1]):
            left = residual[i, j] - factor * carried[i, j]
            residual[i, j] = left
            total += left * left
        sums[i] = total


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
    sums, pairs = np.empty(rows), np.empty((rows, 2))
    products(gradient, carried, sums, 0, rows)
    turn(direction, -np.sum(sums) / energy, gradient, 0, rows + 2)
    carry(direction, residual, x, z, diagonal, carried, pairs, 0, rows)
    energy = np.sum(pairs[:, 0])
    step = np.sum(pairs[:, 1]) / energy
    add(p, step, direction, 0, rows + 2)
    reduce(residual, step, carried, sums, 0, rows)
    return energy, np.sum(sums)
