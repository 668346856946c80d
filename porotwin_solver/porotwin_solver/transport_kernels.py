"""Compiled kernels of `transport`: the steps of the cells, and what crosses their faces."""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.compiled import DRY, compiled, sort_by_pace, starting_level


@compiled
def paces(flux_x, flux_z, inflow, outflow, volume, time_step, courant):
    nz, nx = volume.shape
    rate = np.empty((nz, nx))
    for i in range(nz):
        for j in range(nx):
            west, east, south, north = (
                flux_x[i, j],
                flux_x[i, j + 1],
                flux_z[i, j],
                flux_z[i + 1, j],
            )
            leaving = max(east, 0.0) - min(west, 0.0) + max(north, 0.0) - min(south, 0.0)
            coming = max(west, 0.0) - min(east, 0.0) + max(south, 0.0) - min(north, 0.0)
            rate[i, j] = max(leaving + outflow[i, j], coming + inflow[i, j]) / volume[i, j]
    level = np.empty((nz, nx), np.int8)
    order, reach = sort_by_pace(rate.ravel(), time_step, courant, level.ravel())
    return level, order, reach


@compiled
def slope(behind, ahead, courant, scheme):
    """Return the limited increment from cell to face; `behind`, `ahead`: differences of cells."""
    if scheme == 0 or behind * ahead <= 0.0:
        return 0.0
    sign = 1.0 if ahead > 0.0 else -1.0
    a, b = abs(ahead), abs(behind)
    superbee = max(min(a, 2.0 * b), min(2.0 * a, b))
    if scheme == 2:
        third = ((2.0 - courant) * a + (1.0 + courant) * b) / 3.0
        return sign * 0.5 * (1.0 - courant) * min(third, superbee)
    return sign * 0.5 * (1.0 - courant) * superbee


@compiled
def between(value, end):
    """Return `value` moved into the range between zero and `end`."""
    return min(max(value, min(0.0, end)), max(0.0, end))


@compiled
def corrections(
    c,
    west,
    east,
    south,
    north,
    out_w,
    out_e,
    out_s,
    out_n,
    in_w,
    in_e,
    in_s,
    in_n,
    in_well,
    well,
    low,
    high,
    scheme,
):
    """Return what is added to `c` on the west, east, south and north face where they let out.

    out_*, in_*: share of the cell's volume that leaves or enters in one step through that face, and
    through a well, which injects the concentration `well`. `low`, `high`: range of the upstream
    values, the well's excepted.
    """
    half_x = -0.5 * (in_s * (c - south) + in_n * (c - north))
    half_z = -0.5 * (in_w * (c - west) + in_e * (c - east))
    to_w = (
        between(slope(c - east, west - c, out_w, scheme) + half_x, west - c) if out_w > 0.0 else 0.0
    )
    to_e = (
        between(slope(c - west, east - c, out_e, scheme) + half_x, east - c) if out_e > 0.0 else 0.0
    )
    to_s = (
        between(slope(c - north, south - c, out_s, scheme) + half_z, south - c)
        if out_s > 0.0
        else 0.0
    )
    to_n = (
        between(slope(c - south, north - c, out_n, scheme) + half_z, north - c)
        if out_n > 0.0
        else 0.0
    )
    fall = (
        out_w * max(to_w, 0.0)
        + out_e * max(to_e, 0.0)
        + out_s * max(to_s, 0.0)
        + out_n * max(to_n, 0.0)
    )
    rise = -(
        out_w * min(to_w, 0.0)
        + out_e * min(to_e, 0.0)
        + out_s * min(to_s, 0.0)
        + out_n * min(to_n, 0.0)
    )
    if in_well > 0.0:
        low, high = min(low, well), max(high, well)
    room = max(1.0 - (in_w + in_e + in_s + in_n + in_well), 0.0)
    down, up = 1.0, 1.0
    if fall > (c - low) * room:
        down = (c - low) * room / fall
    if rise > (high - c) * room:
        up = (high - c) * room / rise
    to_w *= down if to_w > 0.0 else up
    to_e *= down if to_e > 0.0 else up
    to_s *= down if to_s > 0.0 else up
    to_n *= down if to_n > 0.0 else up
    return to_w, to_e, to_s, to_n


@compiled
def advection(
    c,
    flux_x,
    flux_z,
    inflow,
    tracer,
    outflow,
    volume,
    time_step,
    level,
    order,
    reach,
    scheme,
    rate_x,
    rate_z,
    amount_x,
    amount_z,
    left,
    tape,
):
    """Advance `c` in place; what every cell held before each of its steps goes onto `tape`."""
    top = len(reach) - 1
    taped = 0
    rate_x[:] = 0.0
    rate_z[:] = 0.0
    wet = reached_cells(c, tracer)
    for step in range(1 << top):
        leave(
            c,
            wet,
            flux_x,
            flux_z,
            inflow,
            tracer,
            volume,
            time_step,
            level,
            order,
            reach[starting_level(step, top)],
            scheme,
            rate_x,
            rate_z,
            amount_x,
            amount_z,
        )
        ending = reach[starting_level(step + 1, top)]
        if len(tape) > 0:
            for place in range(ending):
                i, j = divmod(order[place], c.shape[1])
                tape[taped] = c[i, j]
                taped += 1
        arrive(
            c,
            wet,
            flux_x,
            flux_z,
            tracer,
            outflow,
            volume,
            time_step,
            level,
            order,
            ending,
            rate_x,
            rate_z,
            amount_x,
            amount_z,
            left,
        )


@compiled
def reached_cells(c, tracer):
    """Return, flat, 1 where tracer is or comes in; `leave` adds the cells that it goes on to."""
    nz, nx = c.shape
    wet = np.zeros(nz * nx, np.uint8)
    for i in range(nz):
        for j in range(nx):
            if c[i, j] >= DRY or tracer[i, j] > 0.0:
                wet[i * nx + j] = 1
    return wet


@compiled
def leave(
    c,
    wet,
    flux_x,
    flux_z,
    inflow,
    tracer,
    volume,
    time_step,
    level,
    order,
    active,
    scheme,
    rate_x,
    rate_z,
    amount_x,
    amount_z,
):
    """Evaluate the faces through which the first `active` cells let out, for one of their steps."""
    nz, nx = c.shape
    for place in range(active):
        k = order[place]
        if wet[k] == 0:
            continue
        i = k // nx
        j = k - i * nx
        here = c[i, j]
        fw, fe, fs, fn = flux_x[i, j], flux_x[i, j + 1], flux_z[i, j], flux_z[i + 1, j]
        if here < DRY:
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
        length = time_step / (1 << own)
        to_w, to_e, to_s, to_n = 0.0, 0.0, 0.0, 0.0
        if scheme != 0:
            to_w, to_e, to_s, to_n = cell_corrections(
                c, i, j, fw, fe, fs, fn, inflow, tracer, length / volume[i, j], scheme
            )
        if fw < 0.0:
            rate_x[i, j] = fw * (here + to_w)
            if j > 0:
                wet[k - 1] = 1
                if level[i, j - 1] < own:
                    amount_x[i, j] += length * rate_x[i, j]
        if fe > 0.0:
            rate_x[i, j + 1] = fe * (here + to_e)
            if j < nx - 1:
                wet[k + 1] = 1
                if level[i, j + 1] < own:
                    amount_x[i, j + 1] += length * rate_x[i, j + 1]
        if fs < 0.0:
            rate_z[i, j] = fs * (here + to_s)
            if i > 0:
                wet[k - nx] = 1
                if level[i - 1, j] < own:
                    amount_z[i, j] += length * rate_z[i, j]
        if fn > 0.0:
            rate_z[i + 1, j] = fn * (here + to_n)
            if i < nz - 1:
                wet[k + nx] = 1
                if level[i + 1, j] < own:
                    amount_z[i + 1, j] += length * rate_z[i + 1, j]


@compiled
def cell_corrections(c, i, j, fw, fe, fs, fn, inflow, tracer, share, scheme):
    """Return the corrections of cell (i, j); a side of the rig mirrors the cell itself."""
    nz, nx = c.shape
    here = c[i, j]
    west = c[i, j - 1] if j > 0 else here
    east = c[i, j + 1] if j < nx - 1 else here
    south = c[i - 1, j] if i > 0 else here
    north = c[i + 1, j] if i < nz - 1 else here
    if west == here and east == here and south == here and north == here:
        return 0.0, 0.0, 0.0, 0.0
    low, high = here, here
    if fw > 0.0:
        beyond = west if j > 0 else 0.0
        low, high = min(low, beyond), max(high, beyond)
    if fe < 0.0:
        beyond = east if j < nx - 1 else 0.0
        low, high = min(low, beyond), max(high, beyond)
    if fs > 0.0:
        beyond = south if i > 0 else 0.0
        low, high = min(low, beyond), max(high, beyond)
    if fn < 0.0:
        beyond = north if i < nz - 1 else 0.0
        low, high = min(low, beyond), max(high, beyond)
    well = tracer[i, j] / inflow[i, j] if inflow[i, j] > 0.0 else 0.0
    return corrections(
        here,
        west,
        east,
        south,
        north,
        max(-fw, 0.0) * share,
        max(fe, 0.0) * share,
        max(-fs, 0.0) * share,
        max(fn, 0.0) * share,
        max(fw, 0.0) * share,
        max(-fe, 0.0) * share,
        max(fs, 0.0) * share,
        max(-fn, 0.0) * share,
        inflow[i, j] * share,
        well,
        low,
        high,
        scheme,
    )


@compiled
def arrive(
    c,
    wet,
    flux_x,
    flux_z,
    tracer,
    outflow,
    volume,
    time_step,
    level,
    order,
    active,
    rate_x,
    rate_z,
    amount_x,
    amount_z,
    left,
):
    """End one step of the first `active` cells: book what came and went.

    `left`: tracer that left the rig, through wells, leaks and through open sides.
    """
    nz, nx = c.shape
    for place in range(active):
        k = order[place]
        if wet[k] == 0:
            continue
        i = k // nx
        j = k - i * nx
        own = level[i, j]
        length = time_step / (1 << own)
        gain = length * (tracer[i, j] - outflow[i, j] * c[i, j])
        left[0] += length * outflow[i, j] * c[i, j]
        if j == 0:
            left[1] -= length * rate_x[i, j]
        if j == nx - 1:
            left[1] += length * rate_x[i, j + 1]
        if i == 0:
            left[1] -= length * rate_z[i, j]
        if i == nz - 1:
            left[1] += length * rate_z[i + 1, j]
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
            c[i, j] += gain / volume[i, j]
