"""Advection of the tracer: conservative, bounded, sharp at fronts, every cell at its own pace.

    phi dc/dt + div(q c) = f_c        (paper eq. transport)

Space and time are discretised together, unsplit. The value that leaves cell i through a face is

    c_f = c_i + correction,    correction = limited slope + transverse part (corner transport)

- limited slope: Lax-Wendroff with the superbee limiter, or the third-order QUICKEST value kept
  within the superbee region (LeVeque, Finite Volume Methods for Hyperbolic Problems, sec. 6.11;
  Leonard, Comput. Methods Appl. Mech. Eng. 88 (1991) 17-74); zero for first-order upwind;
- transverse part: what enters through the cell's other sides during half a step (Colella, J.
  Comput. Phys. 87 (1990) 171-200; LeVeque, sec. 20.5);
- bounds: c_f lies between the two cells of its face, and the corrections of one cell together are
  scaled such that the cell stays within the range of itself, its upstream neighbours and what is
  injected, in the manner of Zalesak, J. Comput. Phys. 31 (1979) 335-362. No value is ever clipped.

Local time steps: a cell of level l takes 2^l steps of dt / 2^l, so that what leaves it in one step
is at most COURANT of its pore volume. A face is evaluated at the pace of its upstream cell, and
what it carries is booked to both sides: conservative to round-off. The cost grows with the sum of
the cells' Courant numbers, not with the largest one, which sits at a well.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from porotwin_core.grid import FloatArray

from porotwin_solver.compiled import compiled, sort_by_pace, starting_level
from porotwin_solver.flow import FaceField

COURANT = 0.5
"""Largest share of a cell's pore volume that may leave it within one of its steps."""

UPWIND, SUPERBEE, THIRD_ORDER = 0, 1, 2
"""Schemes for the value on a face; the last two differ in how smooth slopes are treated."""


class Sources(NamedTuple):
    """What enters and leaves the cells beside their faces; each (nz, nx) [m^3/s], not negative.

    `inflow` is water that is injected, `tracer` the stock that comes with it (inflow times its
    concentration), `outflow` the water that is taken out at the cell's own concentration.
    """

    inflow: FloatArray
    tracer: FloatArray
    outflow: FloatArray

    @property
    def net(self) -> FloatArray:
        """What the sources add to each cell's water [m^3/s]."""
        return self.inflow - self.outflow


class Pace(NamedTuple):
    """The steps that the cells take within `time_step` [s].

    `level` (nz, nx): the cell takes 2**level steps. `order`: flat indices of the cells, the highest
    level first; `reach[l]`: how many of them have level l or higher.
    """

    time_step: float
    level: NDArray[np.int8]
    order: NDArray[np.int32]
    reach: NDArray[np.int64]


def pace(flux: FaceField, sources: Sources, pore_volume: FloatArray, time_step: float) -> Pace:
    """Return the local time steps for `flux` and `sources` over `time_step` [s].

    `pore_volume` (nz, nx) [m^3] is what stores tracer: porosity times rig volume of the cell, times
    the retardation factor.
    """
    level, order, reach = _pace(
        flux.x, flux.z, sources.inflow, sources.outflow, pore_volume, time_step, COURANT
    )
    return Pace(time_step, level, order, reach)


@compiled
def _pace(flux_x, flux_z, inflow, outflow, volume, time_step, courant):
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


class Carried(NamedTuple):
    """Scratch of one advection: per face the tracer carried per time, and the amount in transit."""

    rate: FaceField
    amount: FaceField

    @classmethod
    def zeros(cls, flux: FaceField) -> 'Carried':
        """Return scratch for the faces of `flux`."""
        return cls(
            FaceField(np.zeros_like(flux.x), np.zeros_like(flux.z)),
            FaceField(np.zeros_like(flux.x), np.zeros_like(flux.z)),
        )


def advect(
    concentration: FloatArray,
    flux: FaceField,
    *,
    sources: Sources,
    pore_volume: FloatArray,
    steps: Pace,
    scheme: int,
    scratch: Carried | None = None,
) -> None:
    """Advance `concentration` (nz, nx) in place by `steps.time_step`.

    The divergence of `flux` must equal `sources.net`; then a constant state stays constant and all
    states stay within the range of the initial and the injected ones. Through open sides comes
    water without tracer.
    """
    carried = Carried.zeros(flux) if scratch is None else scratch
    _advect(
        concentration,
        flux.x,
        flux.z,
        sources.inflow,
        sources.tracer,
        sources.outflow,
        pore_volume,
        steps.time_step,
        steps.level,
        steps.order,
        steps.reach,
        scheme,
        carried.rate.x,
        carried.rate.z,
        carried.amount.x,
        carried.amount.z,
    )


@compiled
def _slope(behind, ahead, courant, scheme):
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
def _between(value, end):
    """Return `value` moved into the range between zero and `end`."""
    return min(max(value, min(0.0, end)), max(0.0, end))


@compiled
def _corrections(
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
        _between(_slope(c - east, west - c, out_w, scheme) + half_x, west - c)
        if out_w > 0.0
        else 0.0
    )
    to_e = (
        _between(_slope(c - west, east - c, out_e, scheme) + half_x, east - c)
        if out_e > 0.0
        else 0.0
    )
    to_s = (
        _between(_slope(c - north, south - c, out_s, scheme) + half_z, south - c)
        if out_s > 0.0
        else 0.0
    )
    to_n = (
        _between(_slope(c - south, north - c, out_n, scheme) + half_z, north - c)
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
def _advect(
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
):
    top = len(reach) - 1
    rate_x[:] = 0.0
    rate_z[:] = 0.0
    for step in range(1 << top):
        _leave(
            c,
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
        _arrive(
            c,
            flux_x,
            flux_z,
            tracer,
            outflow,
            volume,
            time_step,
            level,
            order,
            reach[starting_level(step + 1, top)],
            rate_x,
            rate_z,
            amount_x,
            amount_z,
        )


@compiled
def _leave(
    c,
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
        i, j = divmod(order[place], nx)
        here = c[i, j]
        fw, fe, fs, fn = flux_x[i, j], flux_x[i, j + 1], flux_z[i, j], flux_z[i + 1, j]
        if here == 0.0:
            if fw < 0.0:
                rate_x[i, j] = 0.0
            if fe > 0.0:
                rate_x[i, j + 1] = 0.0
            if fs < 0.0:
                rate_z[i, j] = 0.0
            if fn > 0.0:
                rate_z[i + 1, j] = 0.0
            continue
        length = time_step / (1 << level[i, j])
        to_w, to_e, to_s, to_n = 0.0, 0.0, 0.0, 0.0
        if scheme != 0:
            to_w, to_e, to_s, to_n = _cell_corrections(
                c, i, j, fw, fe, fs, fn, inflow, tracer, length / volume[i, j], scheme
            )
        if fw < 0.0:
            rate_x[i, j] = fw * (here + to_w)
            if j > 0 and level[i, j - 1] < level[i, j]:
                amount_x[i, j] += length * rate_x[i, j]
        if fe > 0.0:
            rate_x[i, j + 1] = fe * (here + to_e)
            if j < nx - 1 and level[i, j + 1] < level[i, j]:
                amount_x[i, j + 1] += length * rate_x[i, j + 1]
        if fs < 0.0:
            rate_z[i, j] = fs * (here + to_s)
            if i > 0 and level[i - 1, j] < level[i, j]:
                amount_z[i, j] += length * rate_z[i, j]
        if fn > 0.0:
            rate_z[i + 1, j] = fn * (here + to_n)
            if i < nz - 1 and level[i + 1, j] < level[i, j]:
                amount_z[i + 1, j] += length * rate_z[i + 1, j]


@compiled
def _cell_corrections(c, i, j, fw, fe, fs, fn, inflow, tracer, share, scheme):
    """Return the corrections of cell (i, j); a side of the rig mirrors the cell itself."""
    nz, nx = c.shape
    here = c[i, j]
    west = c[i, j - 1] if j > 0 else here
    east = c[i, j + 1] if j < nx - 1 else here
    south = c[i - 1, j] if i > 0 else here
    north = c[i + 1, j] if i < nz - 1 else here
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
    return _corrections(
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
def _arrive(
    c,
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
):
    """End one step of the first `active` cells: book what came and went."""
    nz, nx = c.shape
    for place in range(active):
        i, j = divmod(order[place], nx)
        own = level[i, j]
        length = time_step / (1 << own)
        gain = length * (tracer[i, j] - outflow[i, j] * c[i, j])
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
