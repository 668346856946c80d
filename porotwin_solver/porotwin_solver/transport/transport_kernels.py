"""Compiled kernels of `transport`: the levels of the cells, and the tracer across their faces.

Arguments that recur: `c` concentration (nz, nx), `flux` a FaceField of water [m^3/s], `sources` as
`transport.Sources`, `storage` (nz, nx) [m^3], `levels` as `TimeStepLevels`, `awake` as
`AwakeCells`, `accumulators` as `transport.FluxAccumulators`.
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

from porotwin_solver.coefficients.compiled import NEGLIGIBLE, compiled
from porotwin_solver.transport.awake_cells import (
    LEAVING_EAST,
    LEAVING_NORTH,
    LEAVING_SOUTH,
    LEAVING_WEST,
    OUTER,
    PUMPED,
    SUMMED,
    SUMMED_EAST,
    SUMMED_NORTH,
    SUMMED_SOUTH,
    SUMMED_WEST,
)
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
def slope_bounds(cfl, scheme):
    """Return the most that a slope may be in units of the smaller difference: ahead and behind.

    The two of superbee hold for every CFL number; Roe's CFL-superbee takes those of this one (Kemm,
    Int. J. Numer. Methods Fluids 67 (2011) 404-440).
    """
    if scheme == Scheme.COMPRESSIVE:
        return 2.0 / (1.0 - cfl), 2.0 / cfl
    return 2.0, 2.0


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
    most_ahead, most_behind = slope_bounds(cfl, scheme)
    superbee = max(min(a, most_behind * b), min(most_ahead * a, b))
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
def phase_count(phase, count_at_least):
    """Return the number of awake cells that take part in a phase; `advection` tells what it is."""
    highest = len(count_at_least) - 1
    return count_at_least[lowest_starting_level((phase + 1) // 2, highest)]


@compiled
def advection(
    c, flux, sources, storage, levels, awake, scheme, accumulators, tracer_lost, tape, first, last
):
    """Advance `c` in place by the phases `first` to `last` - 1.

    The finest substep s has two: phase 2 s evaluates faces, phase 2 s + 1 updates cells.
    `tape` receives the concentration of every awake cell before each of its substeps, unless it has
    no room at all. `tracer_lost` as in `update_cells`.
    """
    taped = 0
    for phase in range(first, last):
        count = phase_count(phase, awake.count_at_least)
        if phase % 2 == 0:
            evaluate_faces(c, flux, sources, levels, awake, scheme, accumulators, 0, count)
            continue
        if len(tape) > 0:
            for place in range(count):
                i = awake.row[place]
                tape[taped] = c[i, awake.order[place] - i * c.shape[1]]
                taped += 1
        update_cells(c, sources, storage, levels, awake, accumulators, tracer_lost, 0, count)


@compiled
def evaluate_faces(c, flux, sources, levels, awake, scheme, accumulators, first, last):
    """Compute the tracer flux through the outflow faces of the awake cells `first` to `last` - 1.

    Threads may work on different cells: a face is written by its upstream cell alone.

    The upstream cell of a face sets its rate, once per substep of that cell. Where the downstream
    cell has a lower level, the volume of tracer is accumulated until that cell is updated.
    """
    nz, nx = c.shape
    duration, level, _, _ = levels
    _, order, row, _, per_storage, flags = awake
    flux_x, flux_z = flux
    inflow, tracer, _ = sources
    rate, amount = accumulators
    rate_x, rate_z = rate
    amount_x, amount_z = amount
    for place in range(first, last):
        i = row[place]
        j = order[place] - i * nx
        flag = flags[place]
        here = c[i, j]
        if here < NEGLIGIBLE:
            if flag & LEAVING_WEST:
                rate_x[i, j] = 0.0
            if flag & LEAVING_EAST:
                rate_x[i, j + 1] = 0.0
            if flag & LEAVING_SOUTH:
                rate_z[i, j] = 0.0
            if flag & LEAVING_NORTH:
                rate_z[i + 1, j] = 0.0
            continue
        fw, fe, fs, fn = flux_x[i, j], flux_x[i, j + 1], flux_z[i, j], flux_z[i + 1, j]
        added = Sides(0.0, 0.0, 0.0, 0.0)
        if scheme != Scheme.UPWIND:
            # beyond a side of the rig lies a copy of the cell
            west = c[i, j - 1] if j > 0 else here
            east = c[i, j + 1] if j < nx - 1 else here
            south = c[i - 1, j] if i > 0 else here
            north = c[i + 1, j] if i < nz - 1 else here
            if west != here or east != here or south != here or north != here:
                cfl_well, well = 0.0, 0.0
                if flag & PUMPED and inflow[i, j] > 0.0:
                    cfl_well = inflow[i, j] * per_storage[place]
                    well = tracer[i, j] / inflow[i, j]
                added = cell_corrections(
                    here,
                    Sides(west, east, south, north),
                    Sides(fw, fe, fs, fn),
                    flag & OUTER,
                    Sides(j > 0, j < nx - 1, i > 0, i < nz - 1),
                    per_storage[place],
                    cfl_well,
                    well,
                    scheme,
                )
        if flag & LEAVING_WEST:
            rate_x[i, j] = fw * (here + added.west)
        if flag & LEAVING_EAST:
            rate_x[i, j + 1] = fe * (here + added.east)
        if flag & LEAVING_SOUTH:
            rate_z[i, j] = fs * (here + added.south)
        if flag & LEAVING_NORTH:
            rate_z[i + 1, j] = fn * (here + added.north)
        if flag & SUMMED:
            length = duration / (1 << level[i, j])
            if flag & LEAVING_WEST and flag & SUMMED_WEST:
                amount_x[i, j] += length * rate_x[i, j]
            if flag & LEAVING_EAST and flag & SUMMED_EAST:
                amount_x[i, j + 1] += length * rate_x[i, j + 1]
            if flag & LEAVING_SOUTH and flag & SUMMED_SOUTH:
                amount_z[i, j] += length * rate_z[i, j]
            if flag & LEAVING_NORTH and flag & SUMMED_NORTH:
                amount_z[i + 1, j] += length * rate_z[i + 1, j]


@compiled
def cell_corrections(here, near, flux, is_outer, inside, cfl_per_flux, cfl_well, well, scheme):
    """Return the corrections of a cell with the concentration `here` and the neighbours `near`.

    `flux`: the water flux through its four sides [m^3/s]; `inside`: whether a neighbour lies there;
    `cfl_per_flux`: substep length divided by storage [s/m^3].
    """
    low, high = here, here
    if flux.west > 0.0:
        low, high = min(low, near.west), max(high, near.west)
    if flux.east < 0.0:
        low, high = min(low, near.east), max(high, near.east)
    if flux.south > 0.0:
        low, high = min(low, near.south), max(high, near.south)
    if flux.north < 0.0:
        low, high = min(low, near.north), max(high, near.north)
    if is_outer and (
        (flux.west > 0.0 and not inside.west)
        or (flux.east < 0.0 and not inside.east)
        or (flux.south > 0.0 and not inside.south)
        or (flux.north < 0.0 and not inside.north)
    ):
        low, high = min(low, 0.0), max(high, 0.0)
    return corrections(
        here,
        near,
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
        cfl_well,
        well,
        low,
        high,
        scheme,
    )


@compiled
def update_cells(c, sources, storage, levels, awake, accumulators, tracer_lost, first, last):
    """End one substep of the awake cells `first` to `last` - 1: add the tracer that has moved.

    Threads may work on different cells.

    `tracer_lost` (2,) [m^3] grows by the tracer that left the rig: first through wells and leaks,
    second through open sides.
    """
    nz, nx = c.shape
    duration, level, _, _ = levels
    _, order, row, _, per_storage, flags = awake
    _, tracer, outflow = sources
    rate, amount = accumulators
    rate_x, rate_z = rate
    amount_x, amount_z = amount
    for place in range(first, last):
        i = row[place]
        j = order[place] - i * nx
        flag = flags[place]
        west, east, south, north = rate_x[i, j], rate_x[i, j + 1], rate_z[i, j], rate_z[i + 1, j]
        summed = 0.0
        if flag & SUMMED:
            if flag & SUMMED_WEST and not flag & LEAVING_WEST:
                summed, west = summed + amount_x[i, j], 0.0
                amount_x[i, j] = 0.0
            if flag & SUMMED_EAST and not flag & LEAVING_EAST:
                summed, east = summed - amount_x[i, j + 1], 0.0
                amount_x[i, j + 1] = 0.0
            if flag & SUMMED_SOUTH and not flag & LEAVING_SOUTH:
                summed, south = summed + amount_z[i, j], 0.0
                amount_z[i, j] = 0.0
            if flag & SUMMED_NORTH and not flag & LEAVING_NORTH:
                summed, north = summed - amount_z[i + 1, j], 0.0
                amount_z[i + 1, j] = 0.0
            summed /= storage[i, j]
        gain = west - east + south - north
        if flag & (PUMPED | OUTER):
            length = duration / (1 << level[i, j])
            lost = outflow[i, j] * c[i, j]
            gain += tracer[i, j] - lost
            tracer_lost[0] += length * lost
            if j == 0:
                tracer_lost[1] -= length * rate_x[i, j]
            if j == nx - 1:
                tracer_lost[1] += length * rate_x[i, j + 1]
            if i == 0:
                tracer_lost[1] -= length * rate_z[i, j]
            if i == nz - 1:
                tracer_lost[1] += length * rate_z[i + 1, j]
        c[i, j] += per_storage[place] * gain + summed
