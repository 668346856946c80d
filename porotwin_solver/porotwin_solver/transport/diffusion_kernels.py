"""Compiled kernels of `diffusion`: pairs of cells, and the tracer that they exchange.

Arguments that recur: `tensor` a DispersionTensor per squared cell size [1/s], (nz, nx) each;
`water` the volume of mobile water (nz, nx) [m^3]; `level` the local time step levels, flat
(nz * nx,). Cells are numbered by their flat index.
"""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.coefficients.compiled import NEGLIGIBLE, compiled
from porotwin_solver.transport.local_time_steps import lowest_starting_level

MAX_SUPERBASE_STEPS = 100
"""Bound on the reductions of a superbase; it suffices for anisotropies beyond 1e20."""

OBTUSE_TOLERANCE = 1e-14
"""Scalar product, relative to the trace of the tensor, that counts as zero."""


@compiled
def superbase(xx, xz, zz, offset, weight):
    """Fill three offsets (column, row) and weights >= 0 with sum of weight offset offset^T = D.

    `offset` (3, 2), `weight` (3,). Selling's formula: a superbase e0 + e1 + e2 = 0 is reduced until
    all products e_i D e_j are <= 0; these are the negative weights, and the offsets are the vectors
    perpendicular to the superbase.
    """
    ax, az, bx, bz = 1, 0, 0, 1
    cx, cz = -1, -1
    for _ in range(MAX_SUPERBASE_STEPS):
        ab = ax * (xx * bx + xz * bz) + az * (xz * bx + zz * bz)
        bc = bx * (xx * cx + xz * cz) + bz * (xz * cx + zz * cz)
        ca = cx * (xx * ax + xz * az) + cz * (xz * ax + zz * az)
        tiny = OBTUSE_TOLERANCE * (xx + zz)
        if ab > tiny:
            ax, az, cx, cz = -ax, -az, ax - bx, az - bz
        elif bc > tiny:
            bx, bz, ax, az = -bx, -bz, bx - cx, bz - cz
        elif ca > tiny:
            cx, cz, bx, bz = -cx, -cz, cx - ax, cz - az
        else:
            break
    offset[0, 0], offset[0, 1] = -cz, cx
    offset[1, 0], offset[1, 1] = -az, ax
    offset[2, 0], offset[2, 1] = -bz, bx
    weight[0] = max(-(ax * (xx * bx + xz * bz) + az * (xz * bx + zz * bz)), 0.0)
    weight[1] = max(-(bx * (xx * cx + xz * cz) + bz * (xz * cx + zz * cz)), 0.0)
    weight[2] = max(-(cx * (xx * ax + xz * az) + cz * (xz * ax + zz * az)), 0.0)


@compiled
def named_pairs(tensor, water):
    """Return the exchanges of cells: `stride`, `ahead`, `behind`, `volume` and `total`.

    `tensor`: DispersionTensor per squared cell size [1/s]; `water` (nz, nx) [m^3]. Each row of
    `stride` and `volume` (nz * nx, 3) names pairs with the cells so far ahead and behind, and half
    of the volume [m^3/s] that the cell's own tensor lets them exchange. `ahead` and `behind`
    (nz * nx, 3) tell whether there is such a cell. `total` (nz * nx,) [m^3/s] is the sum over the
    pairs of each cell. Most pairs are named twice, once by each cell.
    """
    nz, nx = water.shape
    xx, xz, zz = tensor
    size = nz * nx
    offset = np.empty((3, 2), np.int64)
    weight = np.empty(3)
    stride = np.zeros((size, 3), np.int32)
    ahead, behind = np.zeros((size, 3), np.bool_), np.zeros((size, 3), np.bool_)
    volume = np.empty((size, 3))
    total = np.zeros(size)
    for i in range(nz):
        for j in range(nx):
            superbase(xx[i, j], xz[i, j], zz[i, j], offset, weight)
            k = i * nx + j
            for n in range(3):
                if weight[n] <= 0.0:
                    continue
                across, upward = offset[n, 0], offset[n, 1]
                if upward < 0 or (upward == 0 and across < 0):
                    across, upward = -across, -upward
                step = upward * nx + across
                stride[k, n] = step
                volume[k, n] = 0.5 * weight[n] * water[i, j]
                if i + upward < nz and 0 <= j + across < nx:
                    ahead[k, n] = True
                    total[k] += volume[k, n]
                    total[k + step] += volume[k, n]
                if i - upward >= 0 and 0 <= j - across < nx:
                    behind[k, n] = True
                    total[k] += volume[k, n]
                    total[k - step] += volume[k, n]
    return stride, ahead, behind, volume, total


@compiled
def named(stride, side, k, step):
    """Return the place of the pair of cell `k` with this stride on this `side`, or -1.

    `side` is `ahead` or `behind` of `named_pairs`.
    """
    for n in range(3):
        if stride[k, n] == step and side[k, n]:
            return n
    return -1


@compiled
def sort_pairs(stride, ahead, behind, volume, level):
    """Return `start`, `other`, `weight` of Exchanges: each pair once, listed by its faster cell."""
    size = len(level)
    start = np.zeros(size + 1, np.int32)
    for k in range(size):
        for n in range(3):
            step = stride[k, n]
            if ahead[k, n]:
                start[faster(k, k + step, level) + 1] += 1
            if behind[k, n] and named(stride, ahead, k - step, step) < 0:
                start[faster(k, k - step, level) + 1] += 1
    for k in range(size):
        start[k + 1] += start[k]
    stop = start[:-1].copy()
    other = np.empty(start[size], np.int32)
    weight = np.empty(start[size])
    for k in range(size):
        for n in range(3):
            step = stride[k, n]
            if ahead[k, n]:
                owner = faster(k, k + step, level)
                other[stop[owner]] = k + k + step - owner
                weight[stop[owner]] = volume[k, n]
                twin = named(stride, behind, k + step, step)
                if twin >= 0:
                    weight[stop[owner]] += volume[k + step, twin]
                stop[owner] += 1
            if behind[k, n] and named(stride, ahead, k - step, step) < 0:
                owner = faster(k, k - step, level)
                other[stop[owner]] = k + k - step - owner
                weight[stop[owner]] = volume[k, n]
                stop[owner] += 1
    return start, other, weight


@compiled
def faster(one, another, level):
    """Return the cell with the higher level; at equal levels the one with the lower index."""
    if level[one] != level[another]:
        return one if level[one] > level[another] else another
    return min(one, another)


@compiled
def find(other, begin, end, partner):
    """Return the index of `partner` in `other[begin:end]`, or `end` where it is absent."""
    for place in range(begin, end):
        if other[place] == partner:
            return place
    return end


@compiled
def exchange(c, storage, exchanges, tape):
    """Advance the flat `c` in place by `exchanges.levels.duration`.

    `storage` is flat too. `tape` receives the concentration of every cell before each of its
    substeps, unless it has no room at all.
    """
    gain = np.zeros(len(c))
    levels, start, other, weight, _, _ = exchanges
    duration, level_2d, order, count_at_least = levels
    level = level_2d.ravel()
    highest = len(count_at_least) - 1
    taped = 0
    for substep in range(1 << highest):
        for place in range(count_at_least[lowest_starting_level(substep, highest)]):
            k = order[place]
            here = c[k]
            length = duration / (1 << level[k])
            for pair in range(start[k], start[k + 1]):
                partner = other[pair]
                difference = c[partner] - here
                if abs(difference) > NEGLIGIBLE:
                    moved = length * weight[pair] * difference
                    gain[k] += moved
                    gain[partner] -= moved
        for place in range(count_at_least[lowest_starting_level(substep + 1, highest)]):
            k = order[place]
            if len(tape) > 0:
                tape[taped] = c[k]
                taped += 1
            if gain[k] != 0.0:
                c[k] += gain[k] / storage[k]
                gain[k] = 0.0


@compiled
def neighbour_pairs(across, upward, water):
    """Return `start`, `other`, `weight` of Exchanges, and `total` as of `named_pairs`.

    A tensor without cross terms gives the pairs of `named_pairs` and `sort_pairs`. Its two entries
    per squared cell size are `across` and `upward` [1/s], the same in all cells. All cells take one
    step.
    """
    nz, nx = water.shape
    start = np.zeros(nz * nx + 1, np.int32)
    other = np.empty(2 * nz * nx - nz - nx, np.int32)
    weight = np.empty(2 * nz * nx - nz - nx)
    total = np.zeros((nz, nx))
    place = 0
    for i in range(nz):
        for j in range(nx):
            k = i * nx + j
            if i < nz - 1:
                other[place] = k + nx
                weight[place] = 0.5 * upward * water[i, j] + 0.5 * upward * water[i + 1, j]
                total[i, j] += weight[place]
                total[i + 1, j] += weight[place]
                place += 1
            if j < nx - 1:
                other[place] = k + 1
                weight[place] = 0.5 * across * water[i, j] + 0.5 * across * water[i, j + 1]
                total[i, j] += weight[place]
                total[i, j + 1] += weight[place]
                place += 1
            start[k + 1] = place
    return start, other, weight, total


@compiled
def ends_of_tracer(c, ends, first, last):
    """Fill `ends` (nz, 2) of the rows with the first column with tracer, and one after the last."""
    nx = c.shape[1]
    for i in range(first, last):
        low, high = 0, nx
        while low < nx and c[i, low] == 0.0:
            low += 1
        while high > low and c[i, high - 1] == 0.0:
            high -= 1
        ends[i, 0], ends[i, 1] = low, high


@compiled
def reach(ends, i, nx):
    """Return the columns of row `i` with tracer in or beside them: the first, one after the last.

    A row that has none, and none in the rows beside it, has no such columns.
    """
    low, high = nx, 0
    for row in range(max(i - 1, 0), min(i + 2, len(ends))):
        if ends[row, 0] < ends[row, 1]:
            low, high = min(low, ends[row, 0] - 1), max(high, ends[row, 1] + 1)
    return max(low, 0), min(high, nx)


@compiled
def moved(difference, factor, negligible):
    """Return the tracer moved by a difference in concentration; none by a negligible one."""
    return factor * difference if abs(difference) > negligible else 0.0


@compiled
def gains_from_neighbours(c, exchanges, ends, gain, negligible, first, last):
    """Fill the rows of `gain` (nz, nx) [m^3] with what the cells get from their neighbours.

    `ends` as of `ends_of_tracer`. A difference up to `negligible` [-] moves nothing. The sums have
    the order of `exchange`, so the result is the same.
    """
    nz, nx = c.shape
    levels, start, _, weight, _, _ = exchanges
    duration = levels.duration
    for i in range(first, last):
        low, high = reach(ends, i, nx)
        to_right = 1 if i < nz - 1 else 0
        for j in range(low, high):
            k = i * nx + j
            here = c[i, j]
            south = here - c[i - 1, j] if i > 0 else 0.0
            west = here - c[i, j - 1] if j > 0 else 0.0
            north = c[i + 1, j] - here if i < nz - 1 else 0.0
            east = c[i, j + 1] - here if j < nx - 1 else 0.0
            gain[i, j] = 0.0
            if max(abs(south), abs(west), abs(north), abs(east)) <= negligible:
                continue  # most cells: their weights need not be read
            total = 0.0
            if i > 0:
                total -= moved(south, duration * weight[start[k - nx]], negligible)
            if j > 0:
                total -= moved(west, duration * weight[start[k - 1] + to_right], negligible)
            if i < nz - 1:
                total += moved(north, duration * weight[start[k]], negligible)
            if j < nx - 1:
                total += moved(east, duration * weight[start[k] + to_right], negligible)
            gain[i, j] = total


@compiled
def add_gains(c, gain, storage, ends, first, last):
    """Add `gain` to the rows of `c`, in the columns that `gains_from_neighbours` filled."""
    nx = c.shape[1]
    for i in range(first, last):
        low, high = reach(ends, i, nx)
        for j in range(low, high):
            if gain[i, j] != 0.0:
                c[i, j] += gain[i, j] / storage[i, j]
