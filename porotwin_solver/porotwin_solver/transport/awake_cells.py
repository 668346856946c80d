"""The cells whose concentration may change in one call of `advect`; all others sleep.

A cell that has the concentration of all water that enters it keeps it: the scheme adds no
correction on its faces, and the water balance does the rest. So it needs no substep. A cell wakes
where water of another concentration enters, or may arrive within the step. Tracer passes through a
cell in one of its own substeps at the soonest, and never against the flow.

The volume that passes through sleeping cells is their constant flux. They are compared to the
round-off of the stock concentration, which is the error of the map and of the balance.
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.compiled import NEGLIGIBLE, compiled
from porotwin_solver.transport.diffusion_kernels import reach

AT_ONCE, ASLEEP = np.float32(0.0), np.float32(1.0)
AT_THE_END = np.nextafter(ASLEEP, AT_ONCE)
"""Shares of the step until other water enters a cell: none, nearly all, never. A cell with a loss
of tracer is awake until the end, and its loss is counted."""

(
    LEAVING_WEST,
    LEAVING_EAST,
    LEAVING_SOUTH,
    LEAVING_NORTH,
    SUMMED_WEST,
    SUMMED_EAST,
    SUMMED_SOUTH,
    SUMMED_NORTH,
    PUMPED,
    OUTER,
) = (1 << bit for bit in range(10))
"""Flags of an awake cell. Water leaves it through this side. Or tracer is summed there, because the
upstream cell takes more substeps. Or a well, a leak or a water body acts in it. Or it lies at a
side of the rig."""

SUMMED = SUMMED_WEST | SUMMED_EAST | SUMMED_SOUTH | SUMMED_NORTH


class AwakeCells(NamedTuple):
    """The awake cells in the order of `TimeStepLevels`, with the data of their substeps.

    first_change: (nz * nx,); the share of the step until other water may enter a cell, or ASLEEP.
    order: (awake,); flat indices of the cells, the highest level first.
    row: (awake,); their rows.
    count_at_least: (levels,); the number of awake cells with level l or a higher one.
    per_storage: (awake,); length of their substeps divided by their storage [s/m^3].
    flags: (awake,); sums of the flags above.
    """

    first_change: NDArray[np.float32]
    order: NDArray[np.int32]
    row: NDArray[np.int32]
    count_at_least: NDArray[np.int64]
    per_storage: FloatArray
    flags: NDArray[np.int16]


@compiled
def differs(one, another):
    """Return whether two concentrations differ by more than round-off."""
    return abs(one - another) > NEGLIGIBLE


@compiled
def ends_with_sources(c, tracer, ends, first, last):
    """Fill `ends` as `diffusion_kernels.ends_of_tracer`; injected tracer counts too."""
    nx = c.shape[1]
    for i in range(first, last):
        low, high = 0, nx
        while low < nx and c[i, low] == 0.0 and tracer[i, low] == 0.0:
            low += 1
        while high > low and c[i, high - 1] == 0.0 and tracer[i, high - 1] == 0.0:
            high -= 1
        ends[i, 0], ends[i, 1] = low, high


@compiled
def wake(c, flux, sources, ends, first_change, extent, first, last):
    """Fill the rows `first` to `last` - 1 of `first_change` as if nothing passed between cells.

    `ends` as of `ends_with_sources`. `extent` (nz, 2) gets the columns of each row outside which
    all cells sleep: the first one, and one after the last.
    """
    nz, nx = c.shape
    flux_x, flux_z = flux
    inflow, tracer, outflow = sources
    for i in range(first, last):
        first_change[i * nx : (i + 1) * nx] = ASLEEP
        low, high = reach(ends, i, nx)
        extent[i, 0], extent[i, 1] = low, high
        for j in range(low, high):
            here = c[i, j]
            west = c[i, j - 1] if j > 0 else 0.0
            east = c[i, j + 1] if j < nx - 1 else 0.0
            south = c[i - 1, j] if i > 0 else 0.0
            north = c[i + 1, j] if i < nz - 1 else 0.0
            if (
                (differs(west, here) and flux_x[i, j] > 0.0)
                or (differs(east, here) and flux_x[i, j + 1] < 0.0)
                or (differs(south, here) and flux_z[i, j] > 0.0)
                or (differs(north, here) and flux_z[i + 1, j] < 0.0)
                or abs(tracer[i, j] - inflow[i, j] * here) > NEGLIGIBLE * inflow[i, j]
            ):
                first_change[i * nx + j] = AT_ONCE
            elif here >= NEGLIGIBLE and (
                outflow[i, j] > 0.0 or i == 0 or j == 0 or i == nz - 1 or j == nx - 1
            ):
                first_change[i * nx + j] = AT_THE_END


@compiled
def spread(flux, level, first_change, extent):
    """Lower `first_change` where water may bring a change from other cells, and widen `extent`.

    A change enters a cell, acts at the end of its substep, and enters the next cells downstream.
    """
    nz, nx = level.shape
    flux_x, flux_z = flux
    size = nz * nx
    waiting, is_waiting = np.empty(size, np.int32), np.zeros(size, np.bool_)
    count = 0
    for i in range(nz):
        for k in range(i * nx + extent[i, 0], i * nx + extent[i, 1]):
            if first_change[k] == AT_ONCE:
                waiting[count] = k
                is_waiting[k] = True
                count += 1
    place = 0
    while count > 0:
        k = waiting[place]
        place = place + 1 if place + 1 < size else 0
        count -= 1
        is_waiting[k] = False
        i = k // nx
        j = k - i * nx
        parts = np.float32(1 << level[i, j])
        change = np.float32((np.floor(first_change[k] * parts) + np.float32(1.0)) / parts)
        if change >= AT_THE_END:
            continue
        for side in range(4):
            if side == 0:
                reaches, row, column = j > 0 and flux_x[i, j] < 0.0, i, j - 1
            elif side == 1:
                reaches, row, column = j < nx - 1 and flux_x[i, j + 1] > 0.0, i, j + 1
            elif side == 2:
                reaches, row, column = i > 0 and flux_z[i, j] < 0.0, i - 1, j
            else:
                reaches, row, column = i < nz - 1 and flux_z[i + 1, j] > 0.0, i + 1, j
            other = row * nx + column
            if reaches and change < first_change[other]:
                first_change[other] = change
                extent[row, 0] = min(extent[row, 0], column)
                extent[row, 1] = max(extent[row, 1], column + 1)
                if not is_waiting[other]:
                    end = place + count
                    waiting[end if end < size else end - size] = other
                    is_waiting[other] = True
                    count += 1


@compiled
def sort_awake(first_change, level, extent, levels):
    """Return `order` and `count_at_least` of AwakeCells for a number of `levels`."""
    nz, nx = level.shape
    count_at_least = np.zeros(levels, np.int64)
    for i in range(nz):
        for j in range(extent[i, 0], extent[i, 1]):
            if first_change[i * nx + j] < ASLEEP:
                count_at_least[level[i, j]] += 1
    place = np.zeros(levels, np.int64)
    for own in range(levels - 2, -1, -1):
        place[own] = count_at_least[own + 1]
        count_at_least[own] += count_at_least[own + 1]
    order = np.empty(count_at_least[0], np.int32)
    for i in range(nz):
        for j in range(extent[i, 0], extent[i, 1]):
            if first_change[i * nx + j] < ASLEEP:
                own = level[i, j]
                order[place[own]] = i * nx + j
                place[own] += 1
    return order, count_at_least


@compiled
def prepare(c, flux, sources, storage, levels, awake, accumulators, first, last):
    """Fill the rest of `awake` for its cells `first` to `last` - 1.

    The accumulators get the constant rates of tracer from sleeping cells to these cells.
    """
    nz, nx = c.shape
    flux_x, flux_z = flux
    inflow, tracer, outflow = sources
    duration, level, _, _ = levels
    first_change, order, row, _, per_storage, flags = awake
    rate_x, rate_z = accumulators.rate
    for place in range(first, last):
        k = order[place]
        i = k // nx
        j = k - i * nx
        own = level[i, j]
        flag = 0
        water = -flux_x[i, j]
        if j == 0:
            flag |= OUTER
        if j > 0 and water != 0.0 and first_change[k - 1] < ASLEEP:
            flag |= summed(water, level[i, j - 1], own) * SUMMED_WEST
        elif water <= 0.0:
            rate_x[i, j] = -water * sent(c[i, j - 1]) if j > 0 else 0.0
        if water > 0.0:
            flag |= LEAVING_WEST
        water = flux_x[i, j + 1]
        if j == nx - 1:
            flag |= OUTER
        if j < nx - 1 and water != 0.0 and first_change[k + 1] < ASLEEP:
            flag |= summed(water, level[i, j + 1], own) * SUMMED_EAST
        elif water <= 0.0:
            rate_x[i, j + 1] = water * sent(c[i, j + 1]) if j < nx - 1 else 0.0
        if water > 0.0:
            flag |= LEAVING_EAST
        water = -flux_z[i, j]
        if i == 0:
            flag |= OUTER
        if i > 0 and water != 0.0 and first_change[k - nx] < ASLEEP:
            flag |= summed(water, level[i - 1, j], own) * SUMMED_SOUTH
        elif water <= 0.0:
            rate_z[i, j] = -water * sent(c[i - 1, j]) if i > 0 else 0.0
        if water > 0.0:
            flag |= LEAVING_SOUTH
        water = flux_z[i + 1, j]
        if i == nz - 1:
            flag |= OUTER
        if i < nz - 1 and water != 0.0 and first_change[k + nx] < ASLEEP:
            flag |= summed(water, level[i + 1, j], own) * SUMMED_NORTH
        elif water <= 0.0:
            rate_z[i + 1, j] = water * sent(c[i + 1, j]) if i < nz - 1 else 0.0
        if water > 0.0:
            flag |= LEAVING_NORTH
        if inflow[i, j] > 0.0 or tracer[i, j] > 0.0 or outflow[i, j] > 0.0:
            flag |= PUMPED
        row[place] = i
        flags[place] = flag
        per_storage[place] = duration / (1 << own) / storage[i, j]


@compiled
def summed(water, beside, own):
    """Return whether tracer is summed on a face: the upstream cell takes more substeps.

    `water` leaves the cell, or enters it if negative; `beside` and `own` are levels.
    """
    return beside < own if water > 0.0 else beside > own


@compiled
def sent(concentration):
    """Return the concentration that a sleeping cell sends on."""
    return concentration if concentration >= NEGLIGIBLE else 0.0
