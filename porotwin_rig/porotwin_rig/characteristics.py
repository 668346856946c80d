"""Transport along characteristics, traced backward from every vertex.

The concentration at a vertex is the old concentration at the origin of its water (semi-Lagrangian;
Staniforth & Cote 1991). Quintic interpolation reads the old concentration, clipped to the range of
the four neighbours (Bermejo & Staniforth 1992). One interpolation serves an interval, however many
cells the water crosses. So fronts stay sharp.

The velocity is free of sources at every point outside the discs of the wells: an analytic radial
flow for each well plus a remainder that is linear across each box (lowest-order Raviart-Thomas).
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]

FLUSHED = 30.0
"""Exchanges of the water of a disc after which only injected water is in it (exp(-30) = 1e-13)."""

NEAR_WELL = 0.25
"""Longest step of a path toward the middle of a well, in distances from it: a longer one would
jump over a well that is narrower than an element."""


@dataclass(frozen=True)
class Carrier:
    """The velocity field of one interval.

    Args:
        hx: width of an element [m].
        hz: height of an element [m].
        remainder_x: Darcy flux times depth on the faces of the boxes along x, without the radial
            flow of the wells [m^2/s], (nz + 1, nx + 2).
        remainder_z: the same along z, (nz + 2, nx + 1).
        storage: porosity times depth times retardation [m], (nz + 1, nx + 1).
        wells: rows (x [m], z [m], radius [m], rate [m^3/s], concentration [-]), (wells, 5).
        entering: concentration of the water that may enter at the vertices, (nz + 1, nx + 1);
            negative where none can.
        canal: vertices in open water, (nz + 1, nx + 1).
        settling: settling velocity of the tracer [m/s].
        settling_length: height over which the settling velocity falls to zero at the bottom [m].
    """

    hx: float
    hz: float
    remainder_x: FloatArray
    remainder_z: FloatArray
    storage: FloatArray
    wells: FloatArray
    entering: FloatArray
    canal: NDArray[np.bool_]
    settling: float
    settling_length: float = 0.02


@numba.njit(cache=True, nogil=True)
def _flow_at(
    x: float,
    z: float,
    hx: float,
    hz: float,
    ux: FloatArray,
    uz: FloatArray,
    storage: FloatArray,
    wells: FloatArray,
    settling: float,
    settling_length: float,
) -> tuple[float, float, float, float, float]:
    """Return velocity (vx, vz) [m/s], exchange by wells [1/s], injected concentration and
    compression [1/s] at a point."""
    rows, columns = storage.shape
    i = min(max(int(x / hx + 0.5), 0), columns - 1)
    j = min(max(int(z / hz + 0.5), 0), rows - 1)
    left = (i - 0.5) * hx if i > 0 else 0.0
    right = (i + 0.5) * hx if i < columns - 1 else i * hx
    bottom = (j - 0.5) * hz if j > 0 else 0.0
    top = (j + 0.5) * hz if j < rows - 1 else j * hz
    s = (x - left) / (right - left)
    t = (z - bottom) / (top - bottom)
    vx = (1.0 - s) * ux[j, i] + s * ux[j, i + 1]
    vz = (1.0 - t) * uz[j, i] + t * uz[j + 1, i]
    exchange = 0.0
    injected = 0.0
    for w in range(wells.shape[0]):
        dx = x - wells[w, 0]
        dz = z - wells[w, 1]
        distance2 = dx * dx + dz * dz
        radius2 = wells[w, 2] * wells[w, 2]
        strength = wells[w, 3] / (2.0 * math.pi)
        if distance2 < radius2:
            if strength > 0.0:
                source = 2.0 * strength / radius2
                exchange += source
                injected += source * wells[w, 4]
            distance2 = radius2
        vx += strength * dx / distance2
        vz += strength * dz / distance2
    per_storage = 1.0 / storage[j, i]
    if exchange > 0.0:
        injected /= exchange
    compression = 0.0
    vz *= per_storage
    if settling != 0.0:
        fall = math.exp(-z / settling_length)
        vz -= settling * (1.0 - fall)
        compression = settling * fall / settling_length
    return vx * per_storage, vz, exchange * per_storage, injected, compression


@numba.njit(cache=True, nogil=True)
def _quintic_weights(s: float, weights: FloatArray) -> None:
    """Fill the Lagrange weights of the six vertices -2..3 for a point at 0 <= s <= 1."""
    a, b, c, d, e, f = s + 2.0, s + 1.0, s, s - 1.0, s - 2.0, s - 3.0
    weights[0] = -b * c * d * e * f / 120.0
    weights[1] = a * c * d * e * f / 24.0
    weights[2] = -a * b * d * e * f / 12.0
    weights[3] = a * b * c * e * f / 12.0
    weights[4] = -a * b * c * d * f / 24.0
    weights[5] = a * b * c * d * e / 120.0


@numba.njit(cache=True, nogil=True)
def _mirrored(index: int, last: int) -> int:
    if index < 0:
        return -index
    if index > last:
        return 2 * last - index
    return index


@numba.njit(cache=True, nogil=True)
def _read(
    x: float,
    z: float,
    hx: float,
    hz: float,
    field: FloatArray,
    along_x: FloatArray,
    along_z: FloatArray,
) -> tuple[float, float, float]:
    """Return value, lowest and highest neighbour of the vertex `field` at a point."""
    rows, columns = field.shape
    i = min(int(x / hx), columns - 2)
    j = min(int(z / hz), rows - 2)
    a, b, c, d = field[j, i], field[j, i + 1], field[j + 1, i], field[j + 1, i + 1]
    low = min(a, b, c, d)
    high = max(a, b, c, d)
    if high - low < 1e-12:
        return low, low, high
    _quintic_weights(x / hx - i, along_x)
    _quintic_weights(z / hz - j, along_z)
    value = 0.0
    for m in range(6):
        row = _mirrored(j + m - 2, rows - 1)
        line = 0.0
        for n in range(6):
            line += along_x[n] * field[row, _mirrored(i + n - 2, columns - 1)]
        value += along_z[m] * line
    return min(max(value, low), high), low, high


@numba.njit(cache=True, nogil=True)
def _longest_path(x: float, z: float, reach: float, wells: FloatArray) -> float:
    """Return the longest path [m] of one step at a point: `reach`, or less near running wells."""
    for w in range(wells.shape[0]):
        if wells[w, 3] != 0.0:
            distance = math.hypot(x - wells[w, 0], z - wells[w, 1])
            reach = min(reach, max(NEAR_WELL * distance, wells[w, 2]))
    return reach


@numba.njit(cache=True, nogil=True)
def _trace(
    xs: FloatArray,
    zs: FloatArray,
    durations: FloatArray,
    hx: float,
    hz: float,
    ux: FloatArray,
    uz: FloatArray,
    storage: FloatArray,
    wells: FloatArray,
    entering: FloatArray,
    canal: NDArray[np.bool_],
    settling: float,
    settling_length: float,
    field: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return concentration, lower and upper bound at each point after its duration."""
    rows, columns = storage.shape
    width, height = (columns - 1) * hx, (rows - 1) * hz
    arrived = np.empty(xs.size)
    lowest = np.empty(xs.size)
    highest = np.empty(xs.size)
    along_x, along_z = np.empty(6), np.empty(6)
    reach = min(hx, hz)
    has_canal = canal.any()
    for p in range(xs.size):
        x, z, remaining = xs[p], zs[p], durations[p]
        flushed = 0.0  # exchanges of the water by injectors along the path
        gained = 0.0  # concentration gained by these exchanges
        squeezed = 0.0  # logarithm of the compression along the path
        fresh = -1.0  # concentration of the water, once it has entered from outside
        while remaining > 0.0:
            column = min(int(x / hx + 0.5), columns - 1)
            row = min(int(z / hz + 0.5), rows - 1)
            if has_canal and canal[row, column]:
                fresh = entering[row, column]
                break
            vx, vz, rate, inflow, squeeze = _flow_at(
                x, z, hx, hz, ux, uz, storage, wells, settling, settling_length
            )
            speed = math.sqrt(vx * vx + vz * vz)
            if speed * remaining < 1e-12 and rate == 0.0:
                break
            step = remaining
            if speed * step > NEAR_WELL * reach:
                step = min(step, _longest_path(x, z, reach, wells) / speed)
            if rate * step > 0.5:
                step = 0.5 / rate
            half = 0.5 * step
            kx2, kz2, rate2, inflow2, squeeze2 = _flow_at(
                x - half * vx, z - half * vz,
                hx, hz, ux, uz, storage, wells, settling, settling_length,
            )  # fmt: skip
            kx3, kz3, _, _, _ = _flow_at(
                x - half * kx2, z - half * kz2,
                hx, hz, ux, uz, storage, wells, settling, settling_length,
            )  # fmt: skip
            kx4, kz4, rate4, inflow4, squeeze4 = _flow_at(
                x - step * kx3, z - step * kz3,
                hx, hz, ux, uz, storage, wells, settling, settling_length,
            )  # fmt: skip
            x -= step / 6.0 * (vx + 2.0 * kx2 + 2.0 * kx3 + kx4)
            z -= step / 6.0 * (vz + 2.0 * kz2 + 2.0 * kz3 + kz4)
            mean_rate = (rate + 4.0 * rate2 + rate4) / 6.0
            squeezed += step * (squeeze + 4.0 * squeeze2 + squeeze4) / 6.0
            if mean_rate > 0.0:
                mixed = (rate * inflow + 4.0 * rate2 * inflow2 + rate4 * inflow4) / (
                    6.0 * mean_rate
                )
                gained += math.exp(-flushed) * (1.0 - math.exp(-mean_rate * step)) * mixed
                flushed += mean_rate * step
                if flushed > FLUSHED:
                    break
            remaining -= step
            if x < 0.0 or x > width or z < 0.0 or z > height:
                x, z = min(max(x, 0.0), width), min(max(z, 0.0), height)
                fresh = entering[
                    min(int(z / hz + 0.5), rows - 1), min(int(x / hx + 0.5), columns - 1)
                ]
                if fresh >= 0.0:
                    break
        kept = math.exp(-flushed) if flushed < FLUSHED else 0.0
        old, low, high = 0.0, 0.0, 0.0
        if fresh >= 0.0:
            old = low = high = fresh
        elif kept > 0.0:
            old, low, high = _read(x, z, hx, hz, field, along_x, along_z)
        growth = math.exp(squeezed)
        arrived[p] = (kept * old + gained) * growth
        lowest[p] = (kept * low + gained) * growth
        highest[p] = (kept * high + gained) * growth
    return arrived, lowest, highest


def inflow_through_rim(
    carrier: Carrier, x: float, z: float, radius: float, angle: FloatArray
) -> FloatArray:
    """Return the water that enters a circle at points of its rim [m^2/s], as `angle`.

    It is the Darcy flux times the depth, inward. Water that passes by the well makes it larger on
    the side it comes from.

    Args:
        carrier: the velocity field.
        x: place of the middle [m].
        z: height of the middle [m].
        radius: radius [m].
        angle: direction of the points from the middle [rad].
    """
    rows, columns = carrier.storage.shape
    inflow = np.empty(angle.shape)
    for place, direction in enumerate(angle):
        along, up = math.cos(direction), math.sin(direction)
        rim_x, rim_z = x + radius * along, z + radius * up
        vx, vz, *_ = _flow_at(
            rim_x, rim_z, carrier.hx, carrier.hz, carrier.remainder_x, carrier.remainder_z,
            carrier.storage, carrier.wells, 0.0, carrier.settling_length,
        )  # fmt: skip
        row = min(max(int(rim_z / carrier.hz + 0.5), 0), rows - 1)
        column = min(max(int(rim_x / carrier.hx + 0.5), 0), columns - 1)
        inflow[place] = -(vx * along + vz * up) * carrier.storage[row, column]
    return inflow


def arriving(
    carrier: Carrier,
    field: FloatArray,
    *,
    x: FloatArray,
    z: FloatArray,
    duration: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the concentration at points after some time, with lower and upper bounds.

    The bounds are the range of the interpolated neighbours; a mass correction may use this range.
    All arrays except `field` have one shape.

    Args:
        carrier: the velocity field.
        field: concentration at the vertices before, (nz + 1, nx + 1).
        x: places of the points [m].
        z: heights of the points [m].
        duration: time until now of every point [s].
    """
    arrived, lowest, highest = _trace(
        np.ascontiguousarray(x, dtype=float).ravel(),
        np.ascontiguousarray(z, dtype=float).ravel(),
        np.ascontiguousarray(duration, dtype=float).ravel(),
        carrier.hx,
        carrier.hz,
        carrier.remainder_x,
        carrier.remainder_z,
        carrier.storage,
        carrier.wells,
        carrier.entering,
        carrier.canal,
        carrier.settling,
        carrier.settling_length,
        field,
    )
    shape = np.shape(x)
    return arrived.reshape(shape), lowest.reshape(shape), highest.reshape(shape)
