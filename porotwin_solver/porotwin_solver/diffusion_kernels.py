"""Compiled kernels of `diffusion`: pairs of cells, and what they exchange."""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.compiled import DRY, compiled, sort_by_pace, starting_level


@compiled
def superbase(xx, xz, zz, offset, weight):
    """Fill the three offsets (column, row) and weights with sum of weight offset offset^T = D."""
    ax, az, bx, bz = 1, 0, 0, 1
    cx, cz = -1, -1
    for _ in range(100):
        ab = ax * (xx * bx + xz * bz) + az * (xz * bx + zz * bz)
        bc = bx * (xx * cx + xz * cz) + bz * (xz * cx + zz * cz)
        ca = cx * (xx * ax + xz * az) + cz * (xz * ax + zz * az)
        tiny = 1e-14 * (xx + zz)
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
def list_exchanges(xx, xz, zz, water, storage, time_step, largest):
    nz, nx = xx.shape
    size = nz * nx
    offset = np.empty((3, 2), np.int64)
    weight = np.empty(3)
    # Each cell gives half of its own weights to the pairs on both sides of it.
    first = np.empty(6 * size, np.int32)
    second = np.empty(6 * size, np.int32)
    volume = np.empty(6 * size)
    total = np.zeros(size)
    count = 0
    for i in range(nz):
        for j in range(nx):
            superbase(xx[i, j], xz[i, j], zz[i, j], offset, weight)
            for k in range(3):
                if weight[k] <= 0.0:
                    continue
                for side in (-1, 1):
                    m, n = i + side * offset[k, 1], j + side * offset[k, 0]
                    if 0 <= m < nz and 0 <= n < nx:
                        first[count] = i * nx + j
                        second[count] = m * nx + n
                        volume[count] = 0.5 * weight[k] * water[i, j]
                        total[first[count]] += volume[count]
                        total[second[count]] += volume[count]
                        count += 1
    level = np.empty((nz, nx), np.int8)
    flat = level.ravel()
    order, reach = sort_by_pace(total / storage.ravel(), time_step, largest, flat)
    # the two cells of a pair usually both name it: it is listed once, by its faster cell
    room = np.zeros(size + 1, np.int32)
    for k in range(count):
        room[faster(first[k], second[k], flat) + 1] += 1
    for k in range(size):
        room[k + 1] += room[k]
    stop = room[:-1].copy()
    other = np.empty(count, np.int32)
    sorted_volume = np.empty(count)
    for k in range(count):
        owner = faster(first[k], second[k], flat)
        partner = first[k] + second[k] - owner
        place = find(other, room[owner], stop[owner], partner)
        if place == stop[owner]:
            other[place] = partner
            sorted_volume[place] = 0.0
            stop[owner] += 1
        sorted_volume[place] += volume[k]
    start = np.zeros(size + 1, np.int32)
    for k in range(size):
        start[k + 1] = start[k] + stop[k] - room[k]
        for place in range(stop[k] - room[k]):
            other[start[k] + place] = other[room[k] + place]
            sorted_volume[start[k] + place] = sorted_volume[room[k] + place]
    pairs = start[size]
    return start, other[:pairs].copy(), sorted_volume[:pairs].copy(), level, order, reach


@compiled
def faster(one, another, level):
    """Return the one of two cells that has the higher level; of equals the first by number."""
    if level[one] != level[another]:
        return one if level[one] > level[another] else another
    return min(one, another)


@compiled
def find(other, begin, end, partner):
    """Return where `partner` stands in `other[begin:end]`, or `end`."""
    for place in range(begin, end):
        if other[place] == partner:
            return place
    return end


@compiled
def exchange(c, storage, time_step, start, other, weight, level, order, reach, tape):
    """Advance `c` in place; what every cell held before each of its steps goes onto `tape`."""
    gain = np.zeros(len(c))
    top = len(reach) - 1
    taped = 0
    for step in range(1 << top):
        for place in range(reach[starting_level(step, top)]):
            k = order[place]
            here = c[k]
            length = time_step / (1 << level[k])
            for pair in range(start[k], start[k + 1]):
                partner = other[pair]
                difference = c[partner] - here
                if abs(difference) > DRY:
                    moved = length * weight[pair] * difference
                    gain[k] += moved
                    gain[partner] -= moved
        for place in range(reach[starting_level(step + 1, top)]):
            k = order[place]
            if len(tape) > 0:
                tape[taped] = c[k]
                taped += 1
            if gain[k] != 0.0:
                c[k] += gain[k] / storage[k]
                gain[k] = 0.0
