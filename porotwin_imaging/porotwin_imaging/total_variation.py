"""Weighted total-variation denoising: smooths and fills where a photograph says little.

The map u closest to the data f in the sense of Rudin, Osher and Fatemi (paper, sec. 2.2.1),

    min over u of  1/2 int w (u - f)^2 dA + length int |grad u| dA,

weights each place by what the photograph says there: `w` is 1 at full information and 0 where
there is none, so that u is carried in from the surroundings. `length` [m per unit of f] is
physical: a disc of radius r keeps its shape and loses 2 length / r of its height, whatever the
resolution. The discrete problem (forward differences, no flux at the edges) is solved by the
primal-dual method of Chambolle and Pock (J. Math. Imaging Vision 40:120, 2011, algorithm 1). The
duality gap G bounds the distance to the exact minimiser, 1/2 int w (u - u*)^2 dA <= G: the iteration
stops when sqrt(2 G / int w dA), a weighted root mean square error, is below `tolerance`.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Array = NDArray[np.floating]

LEAST_WEIGHT = 1e-3
"""Weights are raised to this, which keeps the problem strictly convex and its gap finite."""
CHECK_EVERY = 20
"""Iterations between two evaluations of the duality gap, which costs about two iterations."""


@dataclass(frozen=True)
class Denoised:
    """`values` (nz, nx); the `error` bound reached, in units of the data; `iterations` taken."""

    values: Array
    error: float
    iterations: int


def denoise(
    data: Array,
    weights: Array,
    *,
    spacing: tuple[float, float],
    length: float,
    tolerance: float = 1e-3,
    max_iterations: int = 2000,
) -> Denoised:
    """Return the weighted total-variation minimiser of `data` (nz, nx).

    `weights` (nz, nx) between 0 and 1; NaN data counts as weight 0. `spacing`: (dz, dx) [m].
    `tolerance` in units of the data.
    """
    known = np.isfinite(data)
    weight = np.where(known, np.clip(weights, LEAST_WEIGHT, 1.0), LEAST_WEIGHT).astype(np.float32)
    filled = np.where(known, data, 0.0).astype(np.float32)
    if length <= 0.0:
        return Denoised(filled, 0.0, 0)
    unit = min(spacing)
    along = (np.float32(unit / spacing[0]), np.float32(unit / spacing[1]))
    strength = np.float32(length / unit)
    u, error, iterations = _primal_dual(
        filled, weight, strength, along[0], along[1], np.float32(tolerance), max_iterations
    )
    return Denoised(u, float(error), int(iterations))


@njit(cache=True, parallel=True, fastmath=True)
def _dual_step(p, q, bar, step, strength, az, ax):  # type: ignore[no-untyped-def]
    """Ascend in the dual: p, q <- projection of (p, q) + step grad bar onto length `strength`."""
    nz, nx = bar.shape
    for i in prange(nz):
        last_row = i == nz - 1
        below = bar[i] if last_row else bar[i + 1]
        for j in range(nx - 1):
            a = p[i, j] + step * az * (below[j] - bar[i, j])
            b = q[i, j] + step * ax * (bar[i, j + 1] - bar[i, j])
            scale = strength / max(strength, np.sqrt(a * a + b * b))
            p[i, j] = a * scale
            q[i, j] = b * scale
        a = p[i, nx - 1] + step * az * (below[nx - 1] - bar[i, nx - 1])
        p[i, nx - 1] = a * (strength / max(strength, abs(a)))


@njit(cache=True, parallel=True, fastmath=True)
def _primal_step(u, bar, p, q, f, w, step, az, ax):  # type: ignore[no-untyped-def]
    """Descend in the primal and extrapolate: u <- prox(u + step div (p, q)), bar <- 2 u - old."""
    nz, nx = u.shape
    for i in prange(nz):
        above = p[i - 1] if i > 0 else np.zeros_like(p[0])
        for j in range(nx):
            left = q[i, j - 1] if j > 0 else np.float32(0.0)
            divergence = az * (p[i, j] - above[j]) + ax * (q[i, j] - left)
            old = u[i, j]
            weighted = step * w[i, j]
            new = (old + step * divergence + weighted * f[i, j]) / (np.float32(1.0) + weighted)
            u[i, j] = new
            bar[i, j] = new + new - old


@njit(cache=True, parallel=True)
def _gap(u, p, q, f, w, strength, az, ax):  # type: ignore[no-untyped-def]
    """Return (primal minus dual energy, sum of weights) of the discrete problem."""
    nz, nx = u.shape
    energy = 0.0
    total = 0.0
    for i in prange(nz):
        row = 0.0
        for j in range(nx):
            dz = az * (u[i + 1, j] - u[i, j]) if i < nz - 1 else 0.0
            dx = ax * (u[i, j + 1] - u[i, j]) if j < nx - 1 else 0.0
            misfit = u[i, j] - f[i, j]
            divergence = az * (p[i, j] - (p[i - 1, j] if i > 0 else 0.0)) + ax * (
                q[i, j] - (q[i, j - 1] if j > 0 else 0.0)
            )
            row += 0.5 * w[i, j] * misfit * misfit + strength * np.sqrt(dz * dz + dx * dx)
            row += 0.5 * divergence * divergence / w[i, j] + f[i, j] * divergence
        energy += row
        total += np.sum(w[i])
    return energy, total


@njit(cache=True)
def _primal_dual(f, w, strength, az, ax, tolerance, max_iterations):  # type: ignore[no-untyped-def]
    nz, nx = f.shape
    u = f.copy()
    bar = f.copy()
    p = np.zeros_like(f)
    q = np.zeros_like(f)
    norm_squared = np.float32(4.0) * (az * az + ax * ax)
    # steps with product 1 / |grad|^2; their ratio follows the size of dual and primal moves
    primal = np.float32(1.0) / np.sqrt(norm_squared) * np.float32(2.0)
    dual = np.float32(1.0) / (norm_squared * primal)
    error = np.float64(np.inf)
    count = 0
    while count < max_iterations:
        for _ in range(CHECK_EVERY):
            _dual_step(p, q, bar, dual, strength, az, ax)
            _primal_step(u, bar, p, q, f, w, primal, az, ax)
        count += CHECK_EVERY
        gap, total = _gap(u, p, q, f, w, strength, az, ax)
        error = np.sqrt(2.0 * max(gap, 0.0) / total)
        if error < tolerance:
            break
    return u, error, count
