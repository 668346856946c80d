"""Compiled kernels of `adjoint`: those of transport and diffusion, read backwards.

Sides of a cell are numbered west 0, east 1, south 2, north 3; `k ^ 1` is the side opposite to k.
"""

# mypy: disable-error-code="no-untyped-def"

import numpy as np

from porotwin_solver.compiled import compiled, starting_level
from porotwin_solver.diffusion_kernels import faster, find, superbase
from porotwin_solver.transport_kernels import slope


@compiled
def slope_adjoint(behind, ahead, courant, scheme, bar):
    """Return the derivatives of `bar * slope(...)` by `behind`, `ahead` and `courant`."""
    if scheme == 0 or behind * ahead <= 0.0:
        return 0.0, 0.0, 0.0
    sign = 1.0 if ahead > 0.0 else -1.0
    a, b = abs(ahead), abs(behind)
    half = 0.5 * (1.0 - courant)
    first, second = min(a, 2.0 * b), min(2.0 * a, b)
    if first > second:
        superbee = first
        by_a, by_b = (1.0, 0.0) if a < 2.0 * b else (0.0, 2.0)
    else:
        superbee = second
        by_a, by_b = (2.0, 0.0) if 2.0 * a < b else (0.0, 1.0)
    by_courant = -0.5 * superbee
    by_a *= half
    by_b *= half
    if scheme == 2:
        third = ((2.0 - courant) * a + (1.0 + courant) * b) / 3.0
        if third < superbee:
            by_a = half * (2.0 - courant) / 3.0
            by_b = half * (1.0 + courant) / 3.0
            by_courant = -0.5 * third + half * (b - a) / 3.0
    # the derivative by the signed differences: sign * d|x| / dx = 1
    return bar * by_b, bar * by_a, bar * sign * by_courant


@compiled
def corrections_adjoint(
    c,
    near,
    out,
    coming,
    in_well,
    well,
    beyond,
    bar,
    scheme,
    near_bar,
    out_bar,
    coming_bar,
    beyond_bar,
    raw,
    kept,
):
    """Read `corrections` backwards for one cell.

    `near`: its neighbours, `out`, `coming`: shares through its sides, `beyond`: what lies upstream
    of the sides through which something comes; `bar`: derivatives by the four corrections. Fills
    near_bar, out_bar, coming_bar, beyond_bar and returns the derivatives by the cell itself, by
    `in_well` and by `well`. `raw` and `kept` are scratch of length four.
    """
    half_x = -0.5 * (coming[2] * (c - near[2]) + coming[3] * (c - near[3]))
    half_z = -0.5 * (coming[0] * (c - near[0]) + coming[1] * (c - near[1]))
    fall, rise, arriving = 0.0, 0.0, 0.0
    low, high, low_at, high_at = c, c, -1, -1
    for k in range(4):
        near_bar[k] = 0.0
        out_bar[k] = 0.0
        coming_bar[k] = 0.0
        beyond_bar[k] = 0.0
        raw[k] = 0.0
        kept[k] = 0.0
        arriving += coming[k]
        if out[k] > 0.0:
            half = half_x if k < 2 else half_z
            end = near[k] - c
            raw[k] = slope(c - near[k ^ 1], end, out[k], scheme) + half
            kept[k] = min(max(raw[k], min(0.0, end)), max(0.0, end))
            fall += out[k] * max(kept[k], 0.0)
            rise -= out[k] * min(kept[k], 0.0)
        if coming[k] > 0.0:
            if beyond[k] < low:
                low, low_at = beyond[k], k
            if beyond[k] > high:
                high, high_at = beyond[k], k
    if in_well > 0.0:
        if well < low:
            low, low_at = well, 4
        if well > high:
            high, high_at = well, 4
    open_room = 1.0 - (arriving + in_well)
    room = max(open_room, 0.0)
    down, up = 1.0, 1.0
    down_scaled = fall > (c - low) * room
    up_scaled = rise > (high - c) * room
    if down_scaled:
        down = (c - low) * room / fall
    if up_scaled:
        up = (high - c) * room / rise
    c_bar, well_bar, in_well_bar = 0.0, 0.0, 0.0
    down_bar, up_bar = 0.0, 0.0
    for k in range(4):
        if kept[k] > 0.0:
            down_bar += bar[k] * kept[k]
        else:
            up_bar += bar[k] * kept[k]
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
        in_well_bar -= room_bar
        for k in range(4):
            coming_bar[k] -= room_bar
    for at, value in ((low_at, low_bar), (high_at, high_bar)):
        if at < 0:
            c_bar += value
        elif at == 4:
            well_bar += value
        else:
            beyond_bar[at] += value
    half_x_bar, half_z_bar = 0.0, 0.0
    for k in range(4):
        if out[k] <= 0.0:
            continue
        kept_bar = bar[k] * (down if kept[k] > 0.0 else up)
        if kept[k] > 0.0:
            kept_bar += fall_bar * out[k]
            out_bar[k] += fall_bar * kept[k]
        elif kept[k] < 0.0:
            kept_bar -= rise_bar * out[k]
            out_bar[k] -= rise_bar * kept[k]
        end = near[k] - c
        if raw[k] == kept[k]:
            behind_bar, ahead_bar, courant_bar = slope_adjoint(
                c - near[k ^ 1], end, out[k], scheme, kept_bar
            )
            c_bar += behind_bar - ahead_bar
            near_bar[k ^ 1] -= behind_bar
            near_bar[k] += ahead_bar
            out_bar[k] += courant_bar
            if k < 2:
                half_x_bar += kept_bar
            else:
                half_z_bar += kept_bar
        elif kept[k] == end:
            near_bar[k] += kept_bar
            c_bar -= kept_bar
    for k in range(4):
        half_bar = half_z_bar if k < 2 else half_x_bar
        coming_bar[k] -= 0.5 * half_bar * (c - near[k])
        c_bar -= 0.5 * half_bar * coming[k]
        near_bar[k] += 0.5 * half_bar * coming[k]
    return c_bar, in_well_bar, well_bar


@compiled
def advection_adjoint(
    c,
    bar,
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
    tape,
    flux_x_bar,
    flux_z_bar,
    inflow_bar,
    tracer_bar,
    outflow_bar,
    volume_bar,
):
    """Turn `bar`, the derivative by the concentration after `advection`, into that before it.

    `c` is the concentration after it and becomes that before it; the derivatives by fluxes, sources
    and pore volume are added to theirs.
    """
    nz, nx = c.shape
    rate_x_bar = np.zeros((nz, nx + 1))
    rate_z_bar = np.zeros((nz + 1, nx))
    amount_x_bar = np.zeros((nz, nx + 1))
    amount_z_bar = np.zeros((nz + 1, nx))
    taped = len(tape)
    top = len(reach) - 1
    for step in range((1 << top) - 1, -1, -1):
        ending = reach[starting_level(step + 1, top)]
        taped -= ending
        _arrive_adjoint(
            c,
            bar,
            flux_x,
            flux_z,
            outflow,
            volume,
            time_step,
            level,
            order,
            ending,
            tape[taped : taped + ending],
            rate_x_bar,
            rate_z_bar,
            amount_x_bar,
            amount_z_bar,
            tracer_bar,
            outflow_bar,
            volume_bar,
        )
        _leave_adjoint(
            c,
            bar,
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
            rate_x_bar,
            rate_z_bar,
            amount_x_bar,
            amount_z_bar,
            flux_x_bar,
            flux_z_bar,
            inflow_bar,
            tracer_bar,
            volume_bar,
        )


@compiled
def _arrive_adjoint(
    c,
    bar,
    flux_x,
    flux_z,
    outflow,
    volume,
    time_step,
    level,
    order,
    active,
    tape,
    rate_x_bar,
    rate_z_bar,
    amount_x_bar,
    amount_z_bar,
    tracer_bar,
    outflow_bar,
    volume_bar,
):
    nx = c.shape[1]
    nz = c.shape[0]
    for place in range(active):
        i, j = divmod(order[place], nx)
        own = level[i, j]
        length = time_step / (1 << own)
        gain_bar = bar[i, j] / volume[i, j]
        volume_bar[i, j] -= gain_bar * (c[i, j] - tape[place])
        c[i, j] = tape[place]
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
def _leave_adjoint(
    c,
    bar,
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
    rate_x_bar,
    rate_z_bar,
    amount_x_bar,
    amount_z_bar,
    flux_x_bar,
    flux_z_bar,
    inflow_bar,
    tracer_bar,
    volume_bar,
):
    nz, nx = c.shape
    near, out, coming, beyond = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    carried_bar, added_bar, flow_bar = np.empty(4), np.empty(4), np.empty(4)
    near_bar, out_bar, coming_bar, beyond_bar = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    raw, kept, leaving = np.empty(4), np.empty(4), np.empty(4)
    for place in range(active):
        i, j = divmod(order[place], nx)
        own = level[i, j]
        length = time_step / (1 << own)
        share = length / volume[i, j]
        here = c[i, j]
        # what leaves through each side, positive outwards
        leaving[0], leaving[1] = -flux_x[i, j], flux_x[i, j + 1]
        leaving[2], leaving[3] = -flux_z[i, j], flux_z[i + 1, j]
        inside_w, inside_e, inside_s, inside_n = j > 0, j < nx - 1, i > 0, i < nz - 1
        near[0] = c[i, j - 1] if inside_w else here
        near[1] = c[i, j + 1] if inside_e else here
        near[2] = c[i - 1, j] if inside_s else here
        near[3] = c[i + 1, j] if inside_n else here
        # derivative by what the face carries outwards per time
        carried_bar[0] = -rate_x_bar[i, j]
        carried_bar[1] = rate_x_bar[i, j + 1]
        carried_bar[2] = -rate_z_bar[i, j]
        carried_bar[3] = rate_z_bar[i + 1, j]
        if inside_w and level[i, j - 1] < own:
            carried_bar[0] -= length * amount_x_bar[i, j]
        if inside_e and level[i, j + 1] < own:
            carried_bar[1] += length * amount_x_bar[i, j + 1]
        if inside_s and level[i - 1, j] < own:
            carried_bar[2] -= length * amount_z_bar[i, j]
        if inside_n and level[i + 1, j] < own:
            carried_bar[3] += length * amount_z_bar[i + 1, j]
        if leaving[0] > 0.0:
            rate_x_bar[i, j] = 0.0
        if leaving[1] > 0.0:
            rate_x_bar[i, j + 1] = 0.0
        if leaving[2] > 0.0:
            rate_z_bar[i, j] = 0.0
        if leaving[3] > 0.0:
            rate_z_bar[i + 1, j] = 0.0
        any_bar = False
        for k in range(4):
            out[k] = max(leaving[k], 0.0) * share
            coming[k] = max(-leaving[k], 0.0) * share
            if leaving[k] <= 0.0:
                carried_bar[k] = 0.0
            if carried_bar[k] != 0.0:
                any_bar = True
            added_bar[k] = carried_bar[k] * leaving[k]
        if not any_bar:
            continue
        beyond[0] = near[0] if inside_w else 0.0
        beyond[1] = near[1] if inside_e else 0.0
        beyond[2] = near[2] if inside_s else 0.0
        beyond[3] = near[3] if inside_n else 0.0
        well = tracer[i, j] / inflow[i, j] if inflow[i, j] > 0.0 else 0.0
        here_bar, in_well_bar, well_bar = 0.0, 0.0, 0.0
        if scheme != 0:
            here_bar, in_well_bar, well_bar = corrections_adjoint(
                here,
                near,
                out,
                coming,
                inflow[i, j] * share,
                well,
                beyond,
                added_bar,
                scheme,
                near_bar,
                out_bar,
                coming_bar,
                beyond_bar,
                raw,
                kept,
            )
        share_bar = in_well_bar * inflow[i, j]
        inflow_bar[i, j] += in_well_bar * share
        if inflow[i, j] > 0.0:
            tracer_bar[i, j] += well_bar / inflow[i, j]
            inflow_bar[i, j] -= well_bar * well / inflow[i, j]
        for k in range(4):
            # carried = leaving (here + correction)
            added = 0.0
            if scheme != 0:
                added = _final(kept, k, out, coming, here, beyond, inflow[i, j] * share, well)
            flow_bar[k] = carried_bar[k] * (here + added)
            here_bar += added_bar[k]
            if scheme != 0:
                if leaving[k] > 0.0:
                    flow_bar[k] += out_bar[k] * share
                    share_bar += out_bar[k] * leaving[k]
                else:
                    flow_bar[k] -= coming_bar[k] * share
                    share_bar -= coming_bar[k] * leaving[k]
        volume_bar[i, j] -= share_bar * share / volume[i, j]
        flux_x_bar[i, j] -= flow_bar[0]
        flux_x_bar[i, j + 1] += flow_bar[1]
        flux_z_bar[i, j] -= flow_bar[2]
        flux_z_bar[i + 1, j] += flow_bar[3]
        if scheme != 0:
            if inside_w:
                bar[i, j - 1] += near_bar[0] + beyond_bar[0]
            else:
                here_bar += near_bar[0]
            if inside_e:
                bar[i, j + 1] += near_bar[1] + beyond_bar[1]
            else:
                here_bar += near_bar[1]
            if inside_s:
                bar[i - 1, j] += near_bar[2] + beyond_bar[2]
            else:
                here_bar += near_bar[2]
            if inside_n:
                bar[i + 1, j] += near_bar[3] + beyond_bar[3]
            else:
                here_bar += near_bar[3]
        bar[i, j] += here_bar


@compiled
def _final(kept, side, out, coming, c, beyond, in_well, well):
    """Return the correction of one side as `corrections` does, from the kept ones of all sides."""
    fall, rise, arriving, low, high = 0.0, 0.0, in_well, c, c
    for k in range(4):
        fall += out[k] * max(kept[k], 0.0)
        rise -= out[k] * min(kept[k], 0.0)
        arriving += coming[k]
        if coming[k] > 0.0:
            low, high = min(low, beyond[k]), max(high, beyond[k])
    if in_well > 0.0:
        low, high = min(low, well), max(high, well)
    room = max(1.0 - arriving, 0.0)
    if kept[side] > 0.0:
        return kept[side] * ((c - low) * room / fall if fall > (c - low) * room else 1.0)
    return kept[side] * ((high - c) * room / rise if rise > (high - c) * room else 1.0)


@compiled
def exchange_adjoint(
    c,
    bar,
    storage,
    time_step,
    start,
    other,
    weight,
    level,
    order,
    reach,
    tape,
    weight_bar,
    storage_bar,
):
    """Turn `bar`, the derivative by the concentration after `exchange`, into that before it.

    `c` is the concentration after it and becomes that before it; the derivatives by the weights of
    the pairs and by the storage are added to theirs.
    """
    gain_bar = np.zeros(len(c))
    top = len(reach) - 1
    taped = len(tape)
    for step in range((1 << top) - 1, -1, -1):
        ending = reach[starting_level(step + 1, top)]
        taped -= ending
        for place in range(ending):
            k = order[place]
            gain_bar[k] = bar[k] / storage[k]
            storage_bar[k] -= gain_bar[k] * (c[k] - tape[taped + place])
            c[k] = tape[taped + place]
        for place in range(reach[starting_level(step, top)]):
            k = order[place]
            length = time_step / (1 << level[k])
            for pair in range(start[k], start[k + 1]):
                moved_bar = length * (gain_bar[k] - gain_bar[other[pair]])
                weight_bar[pair] += moved_bar * (c[other[pair]] - c[k])
                bar[other[pair]] += moved_bar * weight[pair]
                bar[k] -= moved_bar * weight[pair]


@compiled
def weights_adjoint(
    xx, xz, zz, water, level, start, other, weight_bar, xx_bar, xz_bar, zz_bar, water_bar
):
    """Add the derivatives by the tensor and the volume of water of every cell to theirs."""
    from_side = np.empty((3, 2), np.int64)
    amounts = np.empty(3)
    nz, nx = xx.shape
    flat = level.ravel()
    for i in range(nz):
        for j in range(nx):
            superbase(xx[i, j], xz[i, j], zz[i, j], from_side, amounts)
            for k in range(3):
                if amounts[k] <= 0.0:
                    continue
                total = 0.0
                for side in (-1, 1):
                    m, n = i + side * from_side[k, 1], j + side * from_side[k, 0]
                    if 0 <= m < nz and 0 <= n < nx:
                        one, another = i * nx + j, m * nx + n
                        owner = faster(one, another, flat)
                        partner = one + another - owner
                        total += weight_bar[find(other, start[owner], start[owner + 1], partner)]
                water_bar[i, j] += 0.5 * amounts[k] * total
                amount_bar = 0.5 * water[i, j] * total
                # the two vectors of the superbase whose product is -amounts[k]
                p, q = (k + 1) % 3, (k + 2) % 3
                px, pz = from_side[p, 1], -from_side[p, 0]
                qx, qz = from_side[q, 1], -from_side[q, 0]
                xx_bar[i, j] -= amount_bar * px * qx
                xz_bar[i, j] -= amount_bar * (px * qz + pz * qx)
                zz_bar[i, j] -= amount_bar * pz * qz
