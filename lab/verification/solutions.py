"""Solutions of the problems in rigs/verification, none of them by the solver's own code."""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import diags
from scipy.sparse.linalg import splu
from scipy.special import ellipj, ellipk

from porotwin_core.geometry.grid import FloatArray

TIMES = 1000
"""Points of an integral over time, and steps of a solution in time."""


def continuous_source(
    x: FloatArray,
    z: FloatArray,
    time: float,
    *,
    rate: float,
    velocity: float,
    dispersivities: tuple[float, float],
) -> FloatArray:
    """Return c at (`x`, `z`) [m] from a source at (0, 0) in a uniform flow along x.

    Wilson and Miller, J. Hydraul. Div. ASCE 104 (1978) 503-514, before the integral is a function
    of wells: c = rate / (4 pi sqrt(D_L D_T)) times the integral of
    exp(-(x - v s)^2 / (4 D_L s) - z^2 / (4 D_T s)) / s over 0 < s < `time` [s]. `rate` is the
    injected one over depth and porosity [m^2/s], `velocity` v [m/s], D = dispersivity [m] times v.
    """
    along, across = (a * velocity for a in dispersivities)
    logs = np.linspace(math.log(1e-6 * time), math.log(time), TIMES)
    total = np.zeros(np.broadcast_shapes(x.shape, z.shape))
    weights = np.full(TIMES, logs[1] - logs[0])
    weights[[0, -1]] *= 0.5
    for weight, s in zip(weights, np.exp(logs), strict=True):
        part = -((x - velocity * s) ** 2) / (4.0 * along * s) - z**2 / (4.0 * across * s)
        total += weight * np.exp(part)
    return rate / (4.0 * math.pi * math.sqrt(along * across)) * total


def push_and_pull(
    edges: FloatArray, times: tuple[float, float], *, strength: float, dispersivity: float
) -> tuple[FloatArray, FloatArray]:
    """Return c in rings between `edges` [m] after an injection and after a withdrawal.

    With s = r^2 / 2: dc/dt + A dc/ds = d/ds (a |A| dc/dr), A = `strength` [m^2/s] while c = 1 is
    injected and -A while it is withdrawn, for `times` [s]. Central differences and the steps of
    Crank and Nicolson: exact to 1e-4 on rings of a thirtieth of the `dispersivity` a [m].
    """
    middle = 0.5 * (edges[1:] + edges[:-1])
    volume = 0.5 * np.diff(edges**2)
    spread = dispersivity * strength / np.diff(middle)
    c = np.zeros(len(middle))
    found = []
    for sign, time in zip((1.0, -1.0), times, strict=True):
        carried = 0.5 * sign * strength
        out = np.zeros(len(c))
        out[:-1] += carried + spread
        out[1:] += spread - carried
        if sign > 0.0:
            out[-1] += strength
        else:
            out[0] += strength
        matrix = diags([-(carried + spread), out, carried - spread], offsets=[-1, 0, 1])
        source = np.zeros(len(c))
        source[0] = strength if sign > 0.0 else 0.0
        held = diags(volume * TIMES / time)
        factor = splu((held + 0.5 * matrix).tocsc())
        explicit = (held - 0.5 * matrix).tocsr()
        for _ in range(TIMES):
            c = factor.solve(explicit @ c + source)
        found.append(c)
    return found[0], found[1]


def chebyshev(count: int, length: float) -> tuple[FloatArray, FloatArray]:
    """Return `count` Chebyshev points from 0 to `length`, and the matrix of the derivative.

    Trefethen, Spectral Methods in MATLAB (2000), ch. 6.
    """
    k = np.arange(count)
    x = np.cos(math.pi * k / (count - 1))
    weight = np.where((k == 0) | (k == count - 1), 2.0, 1.0) * (-1.0) ** k
    gap = x[:, None] - x[None, :] + np.eye(count)
    matrix = np.outer(weight, 1.0 / weight) / gap
    matrix -= np.diag(matrix.sum(axis=1))
    points, derivative = 0.5 * length * (1.0 + x)[::-1], matrix[::-1, ::-1] * 2.0 / length
    return points, derivative


def henry(
    a: float, b: float, length: float, *, counts: tuple[int, int], sea_diffuses: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, z and c(z, x) of Henry's steady problem, by collocation at Chebyshev points.

    a lap(psi) = dc/dx and b lap(c) = u dc/dx + w dc/dz with u = dpsi/dz, w = -dpsi/dx, all in units
    of the height and the inflow. Fresh water enters evenly at the left. At the right the sea has
    c = 1: at every height as Henry has it (`sea_diffuses`), or where its water enters.
    """
    (x, dx), (z, dz) = chebyshev(counts[0], length), chebyshev(counts[1], 1.0)
    nx, nz = counts
    eye_x, eye_z = np.eye(nx), np.eye(nz)
    by_x, by_z = np.kron(eye_z, dx), np.kron(dz, eye_x)
    laplacian = by_x @ by_x + by_z @ by_z
    index = np.arange(nx * nz).reshape(nz, nx)
    left, right = index[:, 0], index[:, -1]
    level = np.concatenate([index[0], index[-1]])
    heights = np.repeat(z, nx)
    eye = np.eye(nx * nz)
    psi, c = heights.copy(), np.repeat(np.clip(x / length, 0, 1)[None, :] ** 4, nz, axis=0).ravel()

    def equations(psi: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
        u, w = by_z @ psi, -(by_x @ psi)
        cx, cz = by_x @ c, by_z @ c
        flow, salt = a * (laplacian @ psi) - cx, b * (laplacian @ c) - u * cx - w * cz
        j = np.block(
            [
                [a * laplacian, -by_x],
                [
                    -(cx[:, None] * by_z) + cz[:, None] * by_x,
                    b * laplacian - u[:, None] * by_x - w[:, None] * by_z,
                ],
            ]
        )
        n = nx * nz
        # the weight of salt water beyond the sand: w = K' (1 - c)
        flow[right] = (a * (by_x @ psi) + 1.0 - c)[right]
        j[right] = np.hstack([a * by_x, -eye])[right]
        for rows in (left, level):
            flow[rows], j[rows] = (psi - heights)[rows], np.hstack([eye, 0.0 * eye])[rows]
        salt[level], j[n + level] = cz[level], np.hstack([0.0 * eye, by_z])[level]
        salt[left] = (c - b * cx)[left]  # fresh water enters with its flux
        j[n + left] = np.hstack([0.0 * eye, eye - b * by_x])[left]
        if sea_diffuses:
            salt[right], j[n + right] = c[right] - 1.0, np.hstack([0.0 * eye, eye])[right]
        else:
            into = np.minimum(u, 0.0)
            salt[right] = (b * cx - into * (c - 1.0))[right]
            by_psi = -((u < 0.0) * (c - 1.0))[:, None] * by_z
            j[n + right] = np.hstack([by_psi, b * by_x - into[:, None] * eye])[right]
        return np.concatenate([flow, salt]), j

    for _ in range(60):
        left_over, jacobian = equations(psi, c)
        step = np.linalg.solve(jacobian, -left_over)
        size = min(1.0, 0.3 / max(np.abs(step[nx * nz :]).max(), 1e-30))
        psi, c = psi + size * step[: nx * nz], c + size * step[nx * nz :]
        if np.abs(step).max() < 1e-9:
            return x, z, c.reshape(nz, nx)
    raise RuntimeError('Henry: no steady state found')


def discharge_of_a_part(width: float, height: float, share: float) -> float:
    """Return rate / (K depth fall) from the lower `share` of the left side to the right side.

    The rectangle is mapped to a half plane by sn, and this one to another rectangle, in which the
    flow is uniform (Polubarinova-Kochina, Theory of Ground Water Movement, 1962, ch. 4).
    """

    def ratio(m: float) -> float:
        return float(ellipk(1.0 - m) / ellipk(m) - width / height)

    m = brentq(ratio, 1e-12, 1.0 - 1e-12)
    sn = float(ellipj(share * ellipk(m), m)[0])
    square = m * sn**2
    return float(ellipk(square) / ellipk(1.0 - square))
