"""Compiled kernels: the adjoint of `diffusion_kernels`."""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.coefficients.compiled import compiled
from porotwin_solver.transport.diffusion_kernels import faster, find, superbase
from porotwin_solver.transport.line_kernels import offset_at, substitute
from porotwin_solver.transport.local_time_steps import lowest_starting_level


@compiled
def exchange_adjoint(c, bar, storage, exchanges, tape, weight_bar, storage_bar):
    """Turn `bar` in place from dJ/d(concentration after `exchange`) into dJ/d(the one before).

    `c` is the concentration after it and becomes the one before it, read from `tape`. dJ/dweight
    and dJ/dstorage are added to `weight_bar` (pairs,) and `storage_bar`. All cell arrays are flat.
    """
    levels, start, other, weight, _, _ = exchanges
    duration, level_2d, order, count_at_least = levels
    level = level_2d.ravel()
    gain_bar = np.zeros(len(c))
    highest = len(count_at_least) - 1
    taped = len(tape)
    for substep in range((1 << highest) - 1, -1, -1):
        ending = count_at_least[lowest_starting_level(substep + 1, highest)]
        taped -= ending
        for place in range(ending):
            k = order[place]
            gain_bar[k] = bar[k] / storage[k]
            storage_bar[k] -= gain_bar[k] * (c[k] - tape[taped + place])
            c[k] = tape[taped + place]
        for place in range(count_at_least[lowest_starting_level(substep, highest)]):
            k = order[place]
            length = duration / (1 << level[k])
            for pair in range(start[k], start[k + 1]):
                moved_bar = length * (gain_bar[k] - gain_bar[other[pair]])
                weight_bar[pair] += moved_bar * (c[other[pair]] - c[k])
                bar[other[pair]] += moved_bar * weight[pair]
                bar[k] -= moved_bar * weight[pair]


@compiled
def weights_adjoint(tensor, water, exchanges, weight_bar, tensor_bar, water_bar):
    """Add dJ/dtensor and dJ/dwater of every cell, given `weight_bar` = dJ/dweight (pairs,).

    `tensor` and `tensor_bar`: DispersionTensor per squared cell size; `water` (nz, nx) [m^3].
    """
    offset = np.empty((3, 2), np.int64)
    amounts = np.empty(3)
    nz, nx = water.shape
    levels, start, other, _, _, _ = exchanges
    level = levels.level.ravel()
    xx, xz, zz = tensor
    xx_bar, xz_bar, zz_bar = tensor_bar
    for i in range(nz):
        for j in range(nx):
            superbase(xx[i, j], xz[i, j], zz[i, j], offset, amounts)
            for k in range(3):
                if amounts[k] <= 0.0:
                    continue
                total = 0.0
                for side in (-1, 1):
                    m, n = i + side * offset[k, 1], j + side * offset[k, 0]
                    if 0 <= m < nz and 0 <= n < nx:
                        one, another = i * nx + j, m * nx + n
                        owner = faster(one, another, level)
                        partner = one + another - owner
                        total += weight_bar[find(other, start[owner], start[owner + 1], partner)]
                water_bar[i, j] += 0.5 * amounts[k] * total
                amount_bar = 0.5 * water[i, j] * total
                # the two vectors of the superbase with the product -amounts[k]
                p, q = (k + 1) % 3, (k + 2) % 3
                px, pz = offset[p, 1], -offset[p, 0]
                qx, qz = offset[q, 1], -offset[q, 0]
                xx_bar[i, j] -= amount_bar * px * qx
                xz_bar[i, j] -= amount_bar * (px * qz + pz * qx)
                zz_bar[i, j] -= amount_bar * pz * qz


@compiled
def exchange_along_lines_adjoint(c, bar, storage, lines, length, tape, weight_bar, storage_bar):
    """Do as `exchange_adjoint` for `exchange_along_lines`; its substeps have the `length` [s].

    The matrix of a line is symmetric. So `bar / storage` is exchanged as a concentration is, first
    by the values after the substep, then by those before it.
    """
    steps, stride, first, cell, pair, inverse, before, after = lines
    share, new, carried = bar / storage, np.zeros(len(c)), np.zeros(len(c))
    last = np.empty(len(c))
    taped = len(tape)
    for substep in range(steps - 1, -1, -1):
        for place in range(len(stride) - 1, -1, -1):
            n = offset_at(substep, place, len(stride))
            step, begin, end = stride[n], first[n], first[n + 1]
            taped -= end - begin
            for entry in range(begin, end):
                k = cell[entry]
                last[k], c[k] = c[k], tape[taped + entry - begin]
                new[k] = (storage[k] * share[k] + carried[k]) * inverse[entry]
                carried[k] = 0.0
                if after[entry] > 0.0:
                    carried[k + step] = after[entry] * new[k]
            substitute(new, cell, step, inverse, after, begin, end)
            for entry in range(begin, end):
                k = cell[entry]
                storage_bar[k] += new[k] * (c[k] - last[k])
                gain = carried[k]
                carried[k] = 0.0
                if after[entry] > 0.0:
                    by_volume = new[k + step] - new[k]
                    old, late = c[k + step] - c[k], last[k + step] - last[k]
                    part = before[entry] / (before[entry] + after[entry])
                    weight_bar[pair[entry]] -= length * by_volume * (late + part * (old - late))
                    moved = before[entry] * by_volume
                    gain += moved
                    carried[k + step] = -moved
                share[k] = new[k] + gain / storage[k]
    bar[:] = share * storage
