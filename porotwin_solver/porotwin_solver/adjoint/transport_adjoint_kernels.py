"""Compiled kernels: the adjoint of `transport_kernels`.

Arguments that recur: `c`, `flux`, `sources`, `storage`, `levels` and `accumulators` as in
`transport_kernels`; `..._bar` is the derivative of the cost by a quantity, in the shape of it.

The sides of a cell are numbered west 0, east 1, south 2, north 3; `k ^ 1` is opposite to side k.
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.compiled import compiled, inlined
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.transport.awake_cells import differs
from porotwin_solver.transport.local_time_steps import lowest_starting_level
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.transport import FluxAccumulators, Sources
from porotwin_solver.transport.transport_kernels import Sides, slope, slope_bounds

CELL, WELL = -1, 4
"""The bound of a cell's range that is the cell itself, or its well, instead of a side."""


class AdvectionDerivatives(NamedTuple):
    """Derivatives of the cost by the coefficients of advection, in the shapes of these.

    flux: by the water flux through the faces.
    sources: by the water and tracer that wells and leaks add.
    storage: by the storage of the cells, (nz, nx).
    """

    flux: FaceField
    sources: Sources
    storage: FloatArray


class Stencil(NamedTuple):
    """Quantities [-] on the four sides of a cell, (4,) each.

    near: concentration of the neighbour, or of the cell itself at a side of the rig.
    upstream: the same, but 0 at a side of the rig; it bounds the range where water enters.
    cfl_out, cfl_in: fraction of the cell's storage that leaves and enters in one substep.
    """

    near: FloatArray
    upstream: FloatArray
    cfl_out: FloatArray
    cfl_in: FloatArray


class Limited(NamedTuple):
    """Corrections [-] of the face concentrations on the four sides of a cell, (4,) each.

    raw: before they are bounded.
    bounded: within the bounds of their faces.
    scaled: as the cell needs it to stay within its range.
    """

    raw: FloatArray
    bounded: FloatArray
    scaled: FloatArray


@compiled
def slope_adjoint(behind, ahead, cfl, scheme, bar):
    """Return the derivatives of `bar * slope(...)` by `behind`, `ahead` and `cfl`."""
    if scheme == Scheme.UPWIND or behind * ahead <= 0.0:
        return 0.0, 0.0, 0.0
    sign = 1.0 if ahead > 0.0 else -1.0
    a, b = abs(ahead), abs(behind)
    half = 0.5 * (1.0 - cfl)
    most_a, most_b = slope_bounds(cfl, scheme)
    first, second = min(a, most_b * b), min(most_a * a, b)
    widened = 0.0
    if first > second:
        superbee = first
        by_a, by_b = (1.0, 0.0) if a < most_b * b else (0.0, most_b)
        if by_b > 0.0:
            widened = -0.5 * most_b**2 * b
    else:
        superbee = second
        by_a, by_b = (most_a, 0.0) if most_a * a < b else (0.0, 1.0)
        if by_a > 0.0:
            widened = 0.5 * most_a**2 * a
    by_cfl = -0.5 * superbee
    if scheme == Scheme.COMPRESSIVE:
        by_cfl += half * widened
    by_a *= half
    by_b *= half
    if scheme == Scheme.THIRD_ORDER:
        third = ((2.0 - cfl) * a + (1.0 + cfl) * b) / 3.0
        if third < superbee:
            by_a = half * (2.0 - cfl) / 3.0
            by_b = half * (1.0 + cfl) / 3.0
            by_cfl = -0.5 * third + half * (b - a) / 3.0
    # by the signed differences: sign * d|x| / dx = 1
    return bar * by_b, bar * by_a, bar * sign * by_cfl


@inlined
def corrections_adjoint(c, stencil, cfl_well, well, bar, scheme, stencil_bar, limited):
    """Apply the adjoint of `corrections` to the derivatives `bar` (4,) by the four corrections.

    Fills `stencil_bar` and `limited`. Returns the derivatives by the cell `c`, by `cfl_well` and by
    the injected concentration `well`.
    """
    near, upstream, cfl_out, cfl_in = stencil
    near_bar, upstream_bar, cfl_out_bar, cfl_in_bar = stencil_bar
    raw, bounded, scaled = limited
    half_x = -0.5 * (cfl_in[2] * (c - near[2]) + cfl_in[3] * (c - near[3]))
    half_z = -0.5 * (cfl_in[0] * (c - near[0]) + cfl_in[1] * (c - near[1]))
    fall, rise, entering = 0.0, 0.0, 0.0
    low, high, low_at, high_at = c, c, CELL, CELL
    for k in range(4):
        near_bar[k] = 0.0
        cfl_out_bar[k] = 0.0
        cfl_in_bar[k] = 0.0
        upstream_bar[k] = 0.0
        raw[k] = 0.0
        bounded[k] = 0.0
        entering += cfl_in[k]
        if cfl_out[k] > 0.0:
            half = half_x if k < 2 else half_z
            end = near[k] - c
            raw[k] = slope(c - near[k ^ 1], end, cfl_out[k], scheme) + half
            bounded[k] = min(max(raw[k], min(0.0, end)), max(0.0, end))
            fall += cfl_out[k] * max(bounded[k], 0.0)
            rise -= cfl_out[k] * min(bounded[k], 0.0)
        if cfl_in[k] > 0.0:
            if upstream[k] < low:
                low, low_at = upstream[k], k
            if upstream[k] > high:
                high, high_at = upstream[k], k
    if cfl_well > 0.0:
        if well < low:
            low, low_at = well, WELL
        if well > high:
            high, high_at = well, WELL
    open_room = 1.0 - (entering + cfl_well)
    room = max(open_room, 0.0)
    down, up = 1.0, 1.0
    down_scaled = fall > (c - low) * room
    up_scaled = rise > (high - c) * room
    if down_scaled:
        down = (c - low) * room / fall
    if up_scaled:
        up = (high - c) * room / rise
    c_bar, well_bar, cfl_well_bar = 0.0, 0.0, 0.0
    down_bar, up_bar = 0.0, 0.0
    for k in range(4):
        if bounded[k] > 0.0:
            down_bar += bar[k] * bounded[k]
            scaled[k] = bounded[k] * down
        else:
            up_bar += bar[k] * bounded[k]
            scaled[k] = bounded[k] * up
    fall_bar, rise_bar, room_bar, low_bar, high_bar = 0.0, 0.0, 0.0, 0.0, 0.0
    if down_scaled:
        fall_bar = -down_bar * down / fall
        c_bar += down_bar * room / fall
        low_bar -= down_bar * room / fall
        room_bar += down_bar * (c - low) / fall
    if up_scaled:
        rise_bar = -up_bar * up / rise
        c_bar -= up_bar * room / rise
        high_bar += up_bar * room / rise
        room_bar += up_bar * (high - c) / rise
    if open_room > 0.0:
        cfl_well_bar -= room_bar
        for k in range(4):
            cfl_in_bar[k] -= room_bar
    for at, value in ((low_at, low_bar), (high_at, high_bar)):
        if at == CELL:
            c_bar += value
        elif at == WELL:
            well_bar += value
        else:
            upstream_bar[at] += value
    half_x_bar, half_z_bar = 0.0, 0.0
    for k in range(4):
        if cfl_out[k] <= 0.0:
            continue
        bounded_bar = bar[k] * (down if bounded[k] > 0.0 else up)
        if bounded[k] > 0.0:
            bounded_bar += fall_bar * cfl_out[k]
            cfl_out_bar[k] += fall_bar * bounded[k]
        elif bounded[k] < 0.0:
            bounded_bar -= rise_bar * cfl_out[k]
            cfl_out_bar[k] -= rise_bar * bounded[k]
        end = near[k] - c
        if raw[k] == bounded[k]:
            behind_bar, ahead_bar, cfl_bar = slope_adjoint(
                c - near[k ^ 1], end, cfl_out[k], scheme, bounded_bar
            )
            c_bar += behind_bar - ahead_bar
            near_bar[k ^ 1] -= behind_bar
            near_bar[k] += ahead_bar
            cfl_out_bar[k] += cfl_bar
            if k < 2:
                half_x_bar += bounded_bar
            else:
                half_z_bar += bounded_bar
        elif bounded[k] == end:
            near_bar[k] += bounded_bar
            c_bar -= bounded_bar
    for k in range(4):
        half_bar = half_z_bar if k < 2 else half_x_bar
        cfl_in_bar[k] -= 0.5 * half_bar * (c - near[k])
        c_bar -= 0.5 * half_bar * cfl_in[k]
        near_bar[k] += 0.5 * half_bar * cfl_in[k]
    return c_bar, cfl_well_bar, well_bar


@compiled
def advection_adjoint(
    c,
    bar,
    flux,
    sources,
    storage,
    levels,
    scheme,
    tape,
    derivatives,
    least=-np.inf,
    most=np.inf,
):
    """Turn `bar` in place from dJ/d(concentration after `advection`) into dJ/d(the one before).

    `c` is the concentration after it and becomes the one before it, read from the `tape`, an
    `AdvectionTape`. The cells that sleep keep theirs; their derivatives take all substeps.
    dJ/dflux, dJ/dsources and dJ/dstorage are added to `derivatives`. `bar / storage` is moved into
    the range from `least` to `most` before every substep (see `adjoint_state`).
    """
    nz, nx = c.shape
    accumulator_bars = FluxAccumulators(
        FaceField(np.zeros((nz, nx + 1)), np.zeros((nz + 1, nx))),
        FaceField(np.zeros((nz, nx + 1)), np.zeros((nz + 1, nx))),
    )
    is_awake, awake_at_least, values = tape
    taped = len(values)
    highest = len(levels.count_at_least) - 1
    for substep in range((1 << highest) - 1, -1, -1):
        lowest = lowest_starting_level(substep + 1, highest)
        ending = levels.count_at_least[lowest]
        taped -= awake_at_least[lowest]
        update_cells_adjoint(
            c,
            bar,
            flux,
            sources,
            storage,
            levels,
            ending,
            is_awake,
            values[taped:],
            accumulator_bars,
            derivatives,
            least,
            most,
        )
        starting = levels.count_at_least[lowest_starting_level(substep, highest)]
        evaluate_faces_adjoint(
            c,
            bar,
            flux,
            sources,
            storage,
            levels,
            starting,
            scheme,
            accumulator_bars,
            derivatives,
        )


@compiled
def update_cells_adjoint(
    c,
    bar,
    flux,
    sources,
    storage,
    levels,
    active,
    is_awake,
    tape,
    accumulator_bars,
    derivatives,
    least,
    most,
):
    """Apply the adjoint of `update_cells` to the first `active` cells of `levels.order`.

    `tape` holds the concentration of those that are awake before the update. In place: `c` (nz, nx)
    goes back to it, `bar` (nz, nx) becomes the derivative of the cost by it, and `accumulator_bars`
    and `derivatives` receive their shares. `bar / storage` is moved into `least` to `most` first.
    Other arguments are as in `transport_kernels`.
    """
    nz, nx = c.shape
    duration, level, order, _ = levels
    flux_x, flux_z = flux
    rate_bar, amount_bar = accumulator_bars
    rate_x_bar, rate_z_bar = rate_bar
    amount_x_bar, amount_z_bar = amount_bar
    outflow = sources.outflow
    tracer_bar, outflow_bar = derivatives.sources.tracer, derivatives.sources.outflow
    storage_bar = derivatives.storage
    taped = 0
    for place in range(active):
        k = order[place]
        i = k // nx
        j = k - i * nx
        own = level[i, j]
        length = duration / (1 << own)
        gain_bar = bar[i, j] / storage[i, j]
        if gain_bar < least or gain_bar > most:
            gain_bar = min(max(gain_bar, least), most)
            bar[i, j] = gain_bar * storage[i, j]
        if is_awake[k]:
            storage_bar[i, j] -= gain_bar * (c[i, j] - tape[taped])
            c[i, j] = tape[taped]
            taped += 1
        tracer_bar[i, j] += length * gain_bar
        outflow_bar[i, j] -= length * gain_bar * c[i, j]
        bar[i, j] -= length * gain_bar * outflow[i, j]
        if flux_x[i, j] > 0.0 and j > 0 and level[i, j - 1] > own:
            amount_x_bar[i, j] = gain_bar
        else:
            rate_x_bar[i, j] += length * gain_bar
        if flux_x[i, j + 1] < 0.0 and j < nx - 1 and level[i, j + 1] > own:
            amount_x_bar[i, j + 1] = -gain_bar
        else:
            rate_x_bar[i, j + 1] -= length * gain_bar
        if flux_z[i, j] > 0.0 and i > 0 and level[i - 1, j] > own:
            amount_z_bar[i, j] = gain_bar
        else:
            rate_z_bar[i, j] += length * gain_bar
        if flux_z[i + 1, j] < 0.0 and i < nz - 1 and level[i + 1, j] > own:
            amount_z_bar[i + 1, j] = -gain_bar
        else:
            rate_z_bar[i + 1, j] -= length * gain_bar


@compiled
def evaluate_faces_adjoint(
    c, bar, flux, sources, storage, levels, active, scheme, accumulator_bars, derivatives
):
    """Apply the adjoint of `evaluate_faces` to the first `active` cells.

    `bar` (nz, nx), `accumulator_bars` and `derivatives` change in place.

    The loop is one long function that unpacks its arguments first: counting references to arrays
    in every cell would take longer than the arithmetic.
    """
    nz, nx = c.shape
    leaving, carried_bar = np.empty(4), np.empty(4)
    correction_bar, flow_bar = np.empty(4), np.empty(4)
    stencil = Stencil(np.empty(4), np.empty(4), np.empty(4), np.empty(4))
    stencil_bar = Stencil(np.empty(4), np.empty(4), np.empty(4), np.empty(4))
    limited = Limited(np.zeros(4), np.zeros(4), np.zeros(4))
    duration, level, order, _ = levels
    flux_x, flux_z = flux
    inflow, tracer, _ = sources
    rate_bar, amount_bar = accumulator_bars
    rate_x_bar, rate_z_bar = rate_bar
    amount_x_bar, amount_z_bar = amount_bar
    flux_bar, source_bars, storage_bar = derivatives
    flux_x_bar, flux_z_bar = flux_bar
    inflow_bar, tracer_bar, _ = source_bars
    cfl_out_bar, cfl_in_bar = stencil_bar.cfl_out, stencil_bar.cfl_in
    for place in range(active):
        k = order[place]
        i = k // nx
        j = k - i * nx
        own = level[i, j]
        length = duration / (1 << own)
        # water through each side, outward positive
        water = Sides(-flux_x[i, j], flux_x[i, j + 1], -flux_z[i, j], flux_z[i + 1, j])
        # dJ/d(tracer flux through each side, outward); this cell has set the rates of its outflow
        # faces, and earlier values have no effect
        west, east, south, north = 0.0, 0.0, 0.0, 0.0
        if water.west > 0.0:
            west = -rate_x_bar[i, j]
            rate_x_bar[i, j] = 0.0
            if j > 0 and level[i, j - 1] < own:
                west -= length * amount_x_bar[i, j]
        if water.east > 0.0:
            east = rate_x_bar[i, j + 1]
            rate_x_bar[i, j + 1] = 0.0
            if j < nx - 1 and level[i, j + 1] < own:
                east += length * amount_x_bar[i, j + 1]
        if water.south > 0.0:
            south = -rate_z_bar[i, j]
            rate_z_bar[i, j] = 0.0
            if i > 0 and level[i - 1, j] < own:
                south -= length * amount_z_bar[i, j]
        if water.north > 0.0:
            north = rate_z_bar[i + 1, j]
            rate_z_bar[i + 1, j] = 0.0
            if i < nz - 1 and level[i + 1, j] < own:
                north += length * amount_z_bar[i + 1, j]
        if west == 0.0 and east == 0.0 and south == 0.0 and north == 0.0:
            continue
        here = c[i, j]
        cfl_per_flux = length / storage[i, j]
        if scheme != Scheme.UPWIND and is_flat(c, i, j):
            if here != 0.0:
                flux_x_bar[i, j] -= west * here
                flux_x_bar[i, j + 1] += east * here
                flux_z_bar[i, j] -= south * here
                flux_z_bar[i + 1, j] += north * here
            across = west * water.west + east * water.east
            upward = south * water.south + north * water.north
            flat_cell_adjoint(bar, i, j, water, cfl_per_flux, across, upward)
            continue
        leaving[0], leaving[1], leaving[2], leaving[3] = water
        carried_bar[0], carried_bar[1], carried_bar[2], carried_bar[3] = west, east, south, north
        for k in range(4):
            correction_bar[k] = carried_bar[k] * leaving[k]
        well = tracer[i, j] / inflow[i, j] if inflow[i, j] > 0.0 else 0.0
        cfl_well = inflow[i, j] * cfl_per_flux
        here_bar, cfl_well_bar, well_bar = 0.0, 0.0, 0.0
        if scheme != Scheme.UPWIND:
            fill_stencil(c, i, j, leaving, cfl_per_flux, stencil)
            here_bar, cfl_well_bar, well_bar = corrections_adjoint(
                here, stencil, cfl_well, well, correction_bar, scheme, stencil_bar, limited
            )
        cfl_per_flux_bar = cfl_well_bar * inflow[i, j]
        inflow_bar[i, j] += cfl_well_bar * cfl_per_flux
        if inflow[i, j] > 0.0:
            tracer_bar[i, j] += well_bar / inflow[i, j]
            inflow_bar[i, j] -= well_bar * well / inflow[i, j]
        for k in range(4):
            # tracer flux = leaving (here + correction)
            flow_bar[k] = carried_bar[k] * (here + limited.scaled[k])
            here_bar += correction_bar[k]
            if scheme != Scheme.UPWIND:
                if leaving[k] > 0.0:
                    flow_bar[k] += cfl_out_bar[k] * cfl_per_flux
                    cfl_per_flux_bar += cfl_out_bar[k] * leaving[k]
                else:
                    flow_bar[k] -= cfl_in_bar[k] * cfl_per_flux
                    cfl_per_flux_bar -= cfl_in_bar[k] * leaving[k]
        storage_bar[i, j] -= cfl_per_flux_bar * cfl_per_flux / storage[i, j]
        flux_x_bar[i, j] -= flow_bar[0]
        flux_x_bar[i, j + 1] += flow_bar[1]
        flux_z_bar[i, j] -= flow_bar[2]
        flux_z_bar[i + 1, j] += flow_bar[3]
        if scheme != Scheme.UPWIND:
            here_bar = add_to_neighbours(bar, i, j, here_bar, stencil_bar)
        bar[i, j] += here_bar


@compiled
def is_flat(c, i, j):
    """Return whether cell (i, j) and its neighbours have the same concentration, to round-off."""
    nz, nx = c.shape
    here = c[i, j]
    return not (
        (j > 0 and differs(c[i, j - 1], here))
        or (j < nx - 1 and differs(c[i, j + 1], here))
        or (i > 0 and differs(c[i - 1, j], here))
        or (i < nz - 1 and differs(c[i + 1, j], here))
    )


@compiled
def flat_cell_adjoint(bar, i, j, water, cfl_per_flux, across, upward):
    """Do as `evaluate_faces_adjoint` to `bar`, where `is_flat`: the corrections are zero.

    Only the transverse parts of them have a derivative. `water` [m^3/s] leaves through the sides,
    `across` and `upward` are the derivatives by the corrections on the sides west and east, and on
    the others.
    """
    nz, nx = bar.shape
    own = across + upward
    # the water that enters through the other sides
    half_x, half_z = 0.5 * upward * cfl_per_flux, 0.5 * across * cfl_per_flux
    if j > 0 and water.west < 0.0:
        bar[i, j - 1] -= half_x * water.west
        own += half_x * water.west
    if j < nx - 1 and water.east < 0.0:
        bar[i, j + 1] -= half_x * water.east
        own += half_x * water.east
    if i > 0 and water.south < 0.0:
        bar[i - 1, j] -= half_z * water.south
        own += half_z * water.south
    if i < nz - 1 and water.north < 0.0:
        bar[i + 1, j] -= half_z * water.north
        own += half_z * water.north
    bar[i, j] += own


@inlined
def fill_stencil(c, i, j, leaving, cfl_per_flux, stencil):
    """Fill the Stencil of cell (i, j), given the water `leaving` through its sides (4,) [m^3/s].

    `cfl_per_flux`: substep length divided by storage [s/m^3].
    """
    nz, nx = c.shape
    here = c[i, j]
    near, upstream = stencil.near, stencil.upstream
    near[0] = c[i, j - 1] if j > 0 else here
    near[1] = c[i, j + 1] if j < nx - 1 else here
    near[2] = c[i - 1, j] if i > 0 else here
    near[3] = c[i + 1, j] if i < nz - 1 else here
    upstream[0] = near[0] if j > 0 else 0.0
    upstream[1] = near[1] if j < nx - 1 else 0.0
    upstream[2] = near[2] if i > 0 else 0.0
    upstream[3] = near[3] if i < nz - 1 else 0.0
    for k in range(4):
        stencil.cfl_out[k] = max(leaving[k], 0.0) * cfl_per_flux
        stencil.cfl_in[k] = max(-leaving[k], 0.0) * cfl_per_flux


@inlined
def add_to_neighbours(bar, i, j, here_bar, stencil_bar):
    """Add the parts of `stencil_bar.near` and `.upstream` to `bar` (nz, nx) at the neighbours.

    `here_bar` is the derivative by cell (i, j) so far. Returns it plus the parts at the sides of
    the rig, where a neighbour is a copy of the cell.
    """
    nz, nx = bar.shape
    near_bar, upstream_bar = stencil_bar.near, stencil_bar.upstream
    if j > 0:
        bar[i, j - 1] += near_bar[0] + upstream_bar[0]
    else:
        here_bar += near_bar[0]
    if j < nx - 1:
        bar[i, j + 1] += near_bar[1] + upstream_bar[1]
    else:
        here_bar += near_bar[1]
    if i > 0:
        bar[i - 1, j] += near_bar[2] + upstream_bar[2]
    else:
        here_bar += near_bar[2]
    if i < nz - 1:
        bar[i + 1, j] += near_bar[3] + upstream_bar[3]
    else:
        here_bar += near_bar[3]
    return here_bar
