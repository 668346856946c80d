"""Compiled kernels: exchange of tracer along lines of cells, implicit and monotone.

Pairs of cells with one offset form lines. Along each line the exchange is one implicit step, of
Crank and Nicolson where that is monotone, of Euler elsewhere. The lines of one offset follow those
of another (locally one-dimensional splitting; Hundsdorfer and Verwer, Numerical Solution of
Time-Dependent Advection-Diffusion-Reaction Equations, 2003, sec. IV.3). The inverse of each matrix
has no negative entry. So no value leaves the range of the others, for any step and any weights.

Cells are numbered by their flat index; all arrays of cells are flat (nz * nx,).
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.compiled import NEGLIGIBLE, compiled


class Lines(NamedTuple):
    """The cells on lines, offset by offset, in ascending order for each offset.

    steps: substeps, each through all offsets; every second one takes them in reverse order.
    stride: (offsets,); distance of the flat indices of two neighbours on a line.
    first: (offsets + 1,); the entries of offset n are first[n] to first[n + 1] - 1.
    cell: (entries,); flat index of the cell.
    pair: (entries,); index of the pair with the next cell of the line, -1 at its end.
    inverse: (entries,) [1/m^3]; inverse of the diagonal of the eliminated matrix.
    before, after: (entries,) [m^3]; volume exchanged with the next cell in a substep, by the
        concentrations before it and by those after it.
    """

    steps: int
    stride: NDArray[np.int64]
    first: NDArray[np.int64]
    cell: NDArray[np.int32]
    pair: NDArray[np.int32]
    inverse: FloatArray
    before: FloatArray
    after: FloatArray


@compiled
def make_lines(start, other, weight, storage, length):
    """Return all of `Lines` but the steps, for substeps of `length` [s].

    `start`, `other` and `weight` as of `diffusion.Exchanges`; a pair is listed by its lower cell.
    """
    stride, ahead = pairs_by_offset(start, other)
    size, entries = len(storage), len(other)
    for n in range(len(stride)):
        step = stride[n]
        for k in range(size - step):
            if ahead[n, k] >= 0 and ahead[n, k + step] < 0:
                entries += 1  # the end of a line
    first = np.zeros(len(stride) + 1, np.int64)
    cell, pair = np.empty(entries, np.int32), np.empty(entries, np.int32)
    inverse, before, after = np.empty(entries), np.empty(entries), np.empty(entries)
    pivot = np.zeros(size)
    entry = 0
    for n in range(len(stride)):
        step = stride[n]
        for k in range(size):
            come = 0.0
            if k >= step and ahead[n, k - step] >= 0:
                come = length * weight[ahead[n, k - step]]
            if ahead[n, k] < 0 and come == 0.0:
                continue
            gone, halved = 0.0, 0.0
            if ahead[n, k] >= 0:
                gone = length * weight[ahead[n, k]]
                beyond = gone
                if ahead[n, k + step] >= 0:
                    beyond += length * weight[ahead[n, k + step]]
                # monotone where a cell stores half of its exchange or more
                if 0.5 * (gone + come) <= storage[k] and 0.5 * beyond <= storage[k + step]:
                    halved = 0.5 * gone
            cell[entry], pair[entry] = k, ahead[n, k]
            before[entry], after[entry] = halved, gone - halved
            # `pivot`: the part of the diagonal from the elimination of the cells before k
            left = storage[k] + pivot[k]
            pivot[k] = 0.0
            inverse[entry] = 1.0 / (left + after[entry])
            if gone > 0.0:
                pivot[k + step] = after[entry] * left * inverse[entry]
            entry += 1
        first[n + 1] = entry
    return stride, first, cell, pair, inverse, before, after


@compiled
def pairs_by_offset(start, other):
    """Return the stride of each offset, and the pair of each cell with the next one, or -1.

    The shapes are (offsets,) and (offsets, cells); a cell of the last ones has no next one.
    """
    size = len(start) - 1
    number = np.full(size, -1, np.int32)
    stride = np.empty(size, np.int64)
    count = 0
    for k in range(size):
        for place in range(start[k], start[k + 1]):
            step = other[place] - k
            if number[step] < 0:
                number[step] = count
                stride[count] = step
                count += 1
    ahead = np.full((count, size), -1, np.int32)
    for k in range(size):
        for place in range(start[k], start[k + 1]):
            ahead[number[other[place] - k], k] = place
    return stride[:count].copy(), ahead


@compiled
def offset_at(substep, place, offsets):
    """Return the offset whose lines come at `place` in a substep."""
    return place if substep % 2 == 0 else offsets - 1 - place


@compiled
def exchange_along_lines(c, storage, lines, tape):
    """Advance `c` in place by all substeps of `lines`.

    `tape` receives the concentrations before the exchange along each offset, unless it has no room.
    Less than the round-off of a negligible concentration counts as zero.
    """
    steps, stride, first, cell, _, inverse, before, after = lines
    new, carried = np.zeros(len(c)), np.zeros(len(c))
    least = NEGLIGIBLE * NEGLIGIBLE
    taped = 0
    for substep in range(steps):
        for place in range(len(stride)):
            n = offset_at(substep, place, len(stride))
            step, begin, end = stride[n], first[n], first[n + 1]
            if len(tape) > 0:
                for entry in range(begin, end):
                    tape[taped] = c[cell[entry]]
                    taped += 1
            for entry in range(begin, end):
                k = cell[entry]
                total = storage[k] * c[k] + carried[k]
                carried[k] = 0.0
                moved = 0.0
                if before[entry] > 0.0:
                    moved = before[entry] * (c[k + step] - c[k])
                new[k] = (total + moved) * inverse[entry]
                if abs(new[k]) < least:
                    new[k] = 0.0
                if after[entry] > 0.0:
                    carried[k + step] = after[entry] * new[k] - moved
            substitute(new, cell, step, inverse, after, begin, end)
            # the volumes that the new values ask for leave one cell and enter the next
            for entry in range(begin, end):
                k = cell[entry]
                gain = carried[k]
                carried[k] = 0.0
                if after[entry] > 0.0:
                    moved = after[entry] * (new[k + step] - new[k])
                    if before[entry] > 0.0:
                        moved += before[entry] * (c[k + step] - c[k])
                    gain += moved
                    carried[k + step] = -moved
                if gain != 0.0:
                    c[k] += gain / storage[k]


@compiled
def substitute(new, cell, step, inverse, after, begin, end):
    """Substitute the eliminated values of the lines of one offset in `new`, from their ends."""
    for entry in range(end - 1, begin - 1, -1):
        if after[entry] > 0.0:
            k = cell[entry]
            new[k] += after[entry] * inverse[entry] * new[k + step]
