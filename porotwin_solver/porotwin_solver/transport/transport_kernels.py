"""Compiled kernels of `transport`: the levels of the cells, and the tracer across their faces.

Arguments that recur: `c` concentration (nz, nx), `flux` a FaceField of water [m^3/s], `sources` as
`transport.Sources`, `storage` (nz, nx) [m^3], `levels` as `TimeStepLevels`, `accumulators` as
`transport.FluxAccumulators`.
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

import numpy as np

from porotwin_solver.coefficients.compiled import NEGLIGIBLE, compiled
from porotwin_solver.transport.local_time_steps import lowest_starting_level
from porotwin_solver.transport.scheme import Scheme


class Sides(NamedTuple):
    """One number for each side of a cell, in the unit of the caller."""

    west: float
    east: float
    south: float
    north: float


@compiled
def cfl_rates(flux, sources, storage, rate, first, last):
    """Fill the rows `first` to `last` - 1 of `rate` (nz, nx) with the CFL number per time [1/s]."""
    flux_x, flux_z = flux
    inflow, _, outflow = sources
    for i in range(first, last):
        for j in range(storage.shape[1]):
            west, east = flux_x[i, j], flux_x[i, j + 1]
            south, north = flux_z[i, j], flux_z[i + 1, j]
            leaving = max(east, 0.0) - min(west, 0.0) + max(north, 0.0) - min(south, 0.0)
            entering = max(west, 0.0) - min(east, 0.0) + max(south, 0.0) - min(north, 0.0)
            rate[i, j] = max(leaving + outflow[i, j], entering + inflow[i, j]) / storage[i, j]


@compiled
def slope(behind, ahead, cfl, scheme):
    """Return the limited increment from a cell's mean to its face.

    `behind` and `ahead` are the differences to the neighbours: this cell minus the one upstream,
    the one downstream minus this cell. `cfl` is the CFL number of the face.
    """
    if scheme == Scheme.UPWIND or behind * ahead <= 0.0:
        return 0.0
    sign = 1.0 if ahead > 0.0 else -1.0
    a, b = abs(ahead), abs(behind)
    superbee = max(min(a, 2.0 * b), min(2.0 * a, b))
    if scheme == Scheme.THIRD_ORDER:
        third = ((2.0 - cfl) * a + (1.0 + cfl) * b) / 3.0
        return sign * 0.5 * (1.0 - cfl) * min(third, superbee)
    return sign * 0.5 * (1.0 - cfl) * superbee


@compiled
def between(value, end):
    """Return `value` moved into the range between zero and `end`."""
    return min(max(value, min(0.0, end)), max(0.0, end))


@compiled
def corrections(c, near, cfl_out, cfl_in, cfl_well, well, low, high, scheme):
    """Return the corrections to `c` on the outflow faces of a cell, zero on its inflow faces.

    `near`: concentrations of the neighbours. `cfl_out` and `cfl_in`: fraction of the cell's storage
    that leaves and enters through each side in one substep; `cfl_well`: the same through a well,
    which injects the concentration `well`. `low` and `high`: range of the cell and its upstream
    neighbours. The corrections are scaled such that the cell stays within that range.
    """
    half_x = -0.5 * (cfl_in.south * (c - near.south) + cfl_in.north * (c - near.north))
    half_z = -0.5 * (cfl_in.west * (c - near.west) + cfl_in.east * (c - near.east))
    west = (
        between(slope(c - near.east, near.west - c, cfl_out.west, scheme) + half_x, near.west - c)
        if cfl_out.west > 0.0
        else 0.0
    )
    east = (
        between(slope(c - near.west, near.east - c, cfl_out.east, scheme) + half_x, near.east - c)
        if cfl_out.east > 0.0
        else 0.0
    )
    south = (
        between(
            slope(c - near.north, near.south - c, cfl_out.south, scheme) + half_z, near.south - c
        )
        if cfl_out.south > 0.0
        else 0.0
    )
    north = (
        between(
            slope(c - near.south, near.north - c, cfl_out.north, scheme) + half_z, near.north - c
        )
        if cfl_out.north > 0.0
        else 0.0
    )
    fall = (
        cfl_out.west * max(west, 0.0)
        + cfl_out.east * max(east, 0.0)
        + cfl_out.south * max(south, 0.0)
        + cfl_out.north * max(north, 0.0)
    )
    rise = -(
        cfl_out.west * min(west, 0.0)
        + cfl_out.east * min(east, 0.0)
        + cfl_out.south * min(south, 0.0)
        + cfl_out.north * min(north, 0.0)
    )
    if cfl_well > 0.0:
        low, high = min(low, well), max(high, well)
    room = max(1.0 - (cfl_in.west + cfl_in.east + cfl_in.south + cfl_in.north + cfl_well), 0.0)
    down, up = 1.0, 1.0
    if fall > (c - low) * room:
        down = (c - low) * room / fall
    if rise > (high - c) * room:
        up = (high - c) * room / rise
    west *= down if west > 0.0 else up
    east *= down if east > 0.0 else up
    south *= down if south > 0.0 else up
    north *= down if north > 0.0 else up
    return Sides(west, east, south, north)


@compiled
def advection(c, flux, sources, storage, levels, scheme, accumulators, tracer_lost, tape):
    """Advance `c` in place by `levels.duration`.

    `tape` receives the concentration of every cell before each of its substeps, unless it has no
    room at all. `tracer_lost` as in `update_cells`.
    """
    highest = len(levels.count_at_least) - 1
    taped = 0
    reached = np.empty(c.size, np.uint8)
    begin(c, sources, accumulators, reached, 0, len(c))
    for substep in range(1 << highest):
        starting = levels.count_at_least[lowest_starting_level(substep, highest)]
        evaluate_faces(
            c, reached, flux, sources, storage, levels, scheme, accumulators, 0, starting
        )
        ending = levels.count_at_least[lowest_starting_level(substep + 1, highest)]
        if len(tape) > 0:
            for place in range(ending):
                i, j = divmod(levels.order[place], c.shape[1])
                tape[taped] = c[i, j]
                taped += 1
        update_cells(
            c, reached, flux, sources, storage, levels, accumulators, tracer_lost, 0, ending
        )


@compiled
def begin(c, sources, accumulators, reached, first, last):
    """Prepare the rows `first` to `last` - 1 for a call of `advect`: no tracer crosses a face yet.

    `reached` (nz * nx,) becomes 1 where a cell holds or receives tracer, 0 elsewhere.
    `evaluate_faces` adds the cells that the tracer reaches. The kernels skip all others.
    """
    nz, nx = c.shape
    rate_x, rate_z = accumulators.rate
    rate_x[first:last] = 0.0
    rate_z[first : last if last < nz else nz + 1] = 0.0
    for i in range(first, last):
        for j in range(nx):
            found = c[i, j] >= NEGLIGIBLE or sources.tracer[i, j] > 0.0
            reached[i * nx + j] = 1 if found else 0


@compiled
def evaluate_faces(c, reached, flux, sources, storage, levels, scheme, accumulators, first, last):
    """Compute the tracer flux through the outflow faces of the cells `first` to `last` - 1.

    The cells count in the order of `levels`. Threads may work on different cells: a face is
    written by its upstream cell alone, and a cell that another one reaches meanwhile is empty.

    The upstream cell of a face sets its rate, once per substep of that cell. Where the downstream
    cell has a lower level, the volume of tracer is accumulated until that cell is updated.
    """
    nz, nx = c.shape
    duration, level, order, _ = levels
    flux_x, flux_z = flux
    rate, amount = accumulators
    rate_x, rate_z = rate
    amount_x, amount_z = amount
    for place in range(first, last):
        k = order[place]
        if reached[k] == 0:
            continue
        i = k // nx
        j = k - i * nx
        here = c[i, j]
        fw, fe, fs, fn = flux_x[i, j], flux_x[i, j + 1], flux_z[i, j], flux_z[i + 1, j]
        if here < NEGLIGIBLE:
            if fw < 0.0:
                rate_x[i, j] = 0.0
            if fe > 0.0:
                rate_x[i, j + 1] = 0.0
            if fs < 0.0:
                rate_z[i, j] = 0.0
            if fn > 0.0:
                rate_z[i + 1, j] = 0.0
            continue
        own = level[i, j]
        length = duration / (1 << own)
        added = Sides(0.0, 0.0, 0.0, 0.0)
        if scheme != Scheme.UPWIND:
            added = cell_corrections(
                c, i, j, Sides(fw, fe, fs, fn), sources, length / storage[i, j], scheme
            )
        if fw < 0.0:
            rate_x[i, j] = fw * (here + added.west)
            if j > 0:
                reached[k - 1] = 1
                if level[i, j - 1] < own:
                    amount_x[i, j] += length * rate_x[i, j]
        if fe > 0.0:
            rate_x[i, j + 1] = fe * (here + added.east)
            if j < nx - 1:
                reached[k + 1] = 1
                if level[i, j + 1] < own:
                    amount_x[i, j + 1] += length * rate_x[i, j + 1]
        if fs < 0.0:
            rate_z[i, j] = fs * (here + added.south)
            if i > 0:
                reached[k - nx] = 1
                if level[i - 1, j] < own:
                    amount_z[i, j] += length * rate_z[i, j]
        if fn > 0.0:
            rate_z[i + 1, j] = fn * (here + added.north)
            if i < nz - 1:
                reached[k + nx] = 1
                if level[i + 1, j] < own:
                    amount_z[i + 1, j] += length * rate_z[i + 1, j]


@compiled
def cell_corrections(c, i, j, flux, sources, cfl_per_flux, scheme):
    """Return the corrections of cell (i, j); beyond a side of the rig lies a copy of the cell.

    `flux`: the water flux through its four sides [m^3/s]; `cfl_per_flux`: substep length divided by
    storage [s/m^3].
    """
    nz, nx = c.shape
    here = c[i, j]
    west = c[i, j - 1] if j > 0 else here
    east = c[i, j + 1] if j < nx - 1 else here
    south = c[i - 1, j] if i > 0 else here
    north = c[i + 1, j] if i < nz - 1 else here
    if west == here and east == here and south == here and north == here:
        return Sides(0.0, 0.0, 0.0, 0.0)
    low, high = here, here
    if flux.west > 0.0:
        upstream = west if j > 0 else 0.0
        low, high = min(low, upstream), max(high, upstream)
    if flux.east < 0.0:
        upstream = east if j < nx - 1 else 0.0
        low, high = min(low, upstream), max(high, upstream)
    if flux.south > 0.0:
        upstream = south if i > 0 else 0.0
        low, high = min(low, upstream), max(high, upstream)
    if flux.north < 0.0:
        upstream = north if i < nz - 1 else 0.0
        low, high = min(low, upstream), max(high, upstream)
    inflow = sources.inflow[i, j]
    well = sources.tracer[i, j] / inflow if inflow > 0.0 else 0.0
    return corrections(
        here,
        Sides(west, east, south, north),
        Sides(
            max(-flux.west, 0.0) * cfl_per_flux,
            max(flux.east, 0.0) * cfl_per_flux,
            max(-flux.south, 0.0) * cfl_per_flux,
            max(flux.north, 0.0) * cfl_per_flux,
        ),
        Sides(
            max(flux.west, 0.0) * cfl_per_flux,
            max(-flux.east, 0.0) * cfl_per_flux,
            max(flux.south, 0.0) * cfl_per_flux,
            max(-flux.north, 0.0) * cfl_per_flux,
        ),
        inflow * cfl_per_flux,
        well,
        low,
        high,
        scheme,
    )


@compiled
def update_cells(
    c, reached, flux, sources, storage, levels, accumulators, tracer_lost, first, last
):
    """End one substep of the cells `first` to `last` - 1: add the tracer that entered and left.

    The cells count in the order of `levels`. Threads may work on different cells.

    `tracer_lost` (2,) [m^3] grows by the tracer that left the rig: first through wells and leaks,
    second through open sides.
    """
    nz, nx = c.shape
    duration, level, order, _ = levels
    flux_x, flux_z = flux
    _, tracer, outflow = sources
    rate, amount = accumulators
    rate_x, rate_z = rate
    amount_x, amount_z = amount
    for place in range(first, last):
        k = order[place]
        if reached[k] == 0:
            continue
        i = k // nx
        j = k - i * nx
        own = level[i, j]
        length = duration / (1 << own)
        gain = length * (tracer[i, j] - outflow[i, j] * c[i, j])
        tracer_lost[0] += length * outflow[i, j] * c[i, j]
        if j == 0:
            tracer_lost[1] -= length * rate_x[i, j]
        if j == nx - 1:
            tracer_lost[1] += length * rate_x[i, j + 1]
        if i == 0:
            tracer_lost[1] -= length * rate_z[i, j]
        if i == nz - 1:
            tracer_lost[1] += length * rate_z[i + 1, j]
        if flux_x[i, j] > 0.0 and j > 0 and level[i, j - 1] > own:
            gain += amount_x[i, j]
            amount_x[i, j] = 0.0
        else:
            gain += length * rate_x[i, j]
        if flux_x[i, j + 1] < 0.0 and j < nx - 1 and level[i, j + 1] > own:
            gain -= amount_x[i, j + 1]
            amount_x[i, j + 1] = 0.0
        else:
            gain -= length * rate_x[i, j + 1]
        if flux_z[i, j] > 0.0 and i > 0 and level[i - 1, j] > own:
            gain += amount_z[i, j]
            amount_z[i, j] = 0.0
        else:
            gain += length * rate_z[i, j]
        if flux_z[i + 1, j] < 0.0 and i < nz - 1 and level[i + 1, j] > own:
            gain -= amount_z[i + 1, j]
            amount_z[i + 1, j] = 0.0
        else:
            gain -= length * rate_z[i + 1, j]
        if gain != 0.0:
            c[i, j] += gain / storage[i, j]
