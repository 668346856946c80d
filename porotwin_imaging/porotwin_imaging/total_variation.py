"""Weighted total-variation denoising: smooths and fills where a photograph says little.

The map u closest to the data f in the sense of Rudin, Osher and Fatemi (paper, sec. 2.2.1),

    min over u of  1/2 int w (u - f)^2 dA + length int |grad u| dA,

weights each place by what the photograph says there: `w` is 1 at full information, LEAST_WEIGHT
where there is none; data without weight is first carried in from the surroundings. `length` [m per
unit of f] is physical: a disc of radius r keeps its shape and loses 2 length / r of its height,
whatever the resolution. The discrete problem (forward differences, no flux at the edges) is solved
by the accelerated primal-dual method of Chambolle and Pock (J. Math. Imaging Vision 40:120, 2011,
algorithm 2). The duality gap G bounds the distance to the exact minimiser u*,
1/2 int w (u - u*)^2 dA <= G: the iteration stops when sqrt(2 G / int w dA), a weighted root mean
square error, is below the tolerance.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]

LEAST_WEIGHT = 0.05
"""Weights are raised to this: the strong convexity on which the accelerated method rests."""
CHECK_EVERY = 20
"""Iterations between two evaluations of the duality gap, which costs about two iterations."""
MAX_ITERATIONS = 1000
LARGE = 1_000_000
"""Cells from which a map is solved in tiles."""
TILE, HALO = 256, 24
THREADS = 2


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
    tolerance: float = 2e-3,
    max_iterations: int = MAX_ITERATIONS,
) -> Denoised:
    """Return the weighted total-variation minimiser of `data` (nz, nx).

    `weights` (nz, nx) between 0 and 1; NaN data counts as weight 0. `spacing`: (dz, dx) [m].
    `tolerance` in units of the data.
    """
    weight = np.where(np.isfinite(data), np.clip(weights, 0.0, 1.0), 0.0).astype(np.float32)
    filled = fill(data, weight)
    if length <= 0.0:
        return Denoised(filled, 0.0, 0)
    unit = min(spacing)
    constants = (
        np.float32(length / unit),
        np.float32(unit / spacing[0]),
        np.float32(unit / spacing[1]),
        np.float32(tolerance),
        max_iterations,
    )
    weight = np.maximum(weight, np.float32(LEAST_WEIGHT))
    if filled.size > LARGE:
        return _in_tiles(filled, weight, constants)
    u, error, iterations = _primal_dual(filled, weight, *constants)
    return Denoised(u, float(error), int(iterations))


def _in_tiles(data: Array, weight: Array, constants: tuple[Any, ...]) -> Denoised:
    """Return the minimiser of a large map, solved on tiles that overlap by `HALO` cells each way.

    A tile fits into a core's cache, and quiet tiles are done early. What lies further away than the
    halo acts on a cell only through ever more cells that must agree with their own data.
    """
    nz, nx = data.shape
    values = np.empty_like(data)

    def solve(start: tuple[int, int]) -> tuple[float, int]:
        low = [max(0, s - HALO) for s in start]
        outer = tuple(
            slice(a, min(size, s + TILE + HALO))
            for a, s, size in zip(low, start, (nz, nx), strict=True)
        )
        u, error, iterations = _primal_dual(
            np.ascontiguousarray(data[outer]), np.ascontiguousarray(weight[outer]), *constants
        )
        target = tuple(slice(s, s + TILE) for s in start)
        shape = values[target].shape
        inner = tuple(slice(s - a, s - a + n) for s, a, n in zip(start, low, shape, strict=True))
        values[target] = u[inner]
        return float(error), int(iterations)

    starts = [(i, j) for i in range(0, nz, TILE) for j in range(0, nx, TILE)]
    with ThreadPoolExecutor(THREADS) as pool:
        errors, iterations = zip(*pool.map(solve, starts), strict=True)
    return Denoised(values, max(errors), max(iterations))


def fill(data: Array, weight: Array) -> NDArray[np.float32]:
    """Return `data` with places of little weight carried in from their weighted surroundings.

    A pyramid: every level holds weighted means of the one below, and a place takes from its own
    level what its weight allows and the rest from the level above (pull-push, Gortler et al.,
    SIGGRAPH 1996).
    """
    value = np.where(np.isfinite(data), data, 0.0).astype(np.float32) * weight
    return _pulled(value, weight)


def _pulled(weighted: Array, weight: Array) -> NDArray[np.float32]:
    full = np.minimum(weight / np.float32(LEAST_WEIGHT), 1.0)
    own = weighted / np.maximum(weight, 1e-6)
    rows, columns = weight.shape
    if min(rows, columns) < 4 or full.min() >= 1.0:
        total = float(weight.sum())
        rest = float(weighted.sum()) / total if total > 0 else 0.0
        return (full * own + (1.0 - full) * rest).astype(np.float32)
    half = ((columns + 1) // 2, (rows + 1) // 2)
    coarse = _pulled(
        cv2.resize(weighted, half, interpolation=cv2.INTER_AREA),
        cv2.resize(weight, half, interpolation=cv2.INTER_AREA),
    )
    above = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return (full * own + (1.0 - full) * above).astype(np.float32)


@njit(cache=True, nogil=True, fastmath=True, error_model='numpy')
def _dual_row(here, above, p, q, step, strength, az, ax):  # type: ignore[no-untyped-def]
    """Ascend in the dual along one row: (p, q) <- projection of (p, q) + step grad u."""
    one = np.float32(1.0)
    for j in range(here.size - 1):
        a = p[j] + step * az * (above[j] - here[j])
        b = q[j + 1] + step * ax * (here[j + 1] - here[j])
        length = np.sqrt(a * a + b * b) / strength
        scale = one / (length if length > one else one)
        p[j] = a * scale
        q[j + 1] = b * scale
    j = here.size - 1
    a = p[j] + step * az * (above[j] - here[j])
    p[j] = a * (strength / max(strength, abs(a)))


@njit(cache=True, nogil=True, fastmath=True, error_model='numpy')
def _primal_row(u, bar, p, below, q, f, w, step, beyond, az, ax):  # type: ignore[no-untyped-def]
    """Descend in the primal along one row, u <- prox(u + step div (p, q)), and extrapolate."""
    one = np.float32(1.0)
    for j in range(u.size):
        divergence = az * (p[j] - below[j]) + ax * (q[j + 1] - q[j])
        old = u[j]
        weighted = step * w[j]
        new = (old + step * divergence + weighted * f[j]) / (one + weighted)
        u[j] = new
        bar[j] = new + beyond * (new - old)


@njit(cache=True, nogil=True, error_model='numpy')
def _gap(u, p, q, f, w, strength, az, ax):  # type: ignore[no-untyped-def]
    """Return (primal minus dual energy, sum of weights) of the discrete problem."""
    nz, nx = u.shape
    energy = 0.0
    total = 0.0
    for i in range(nz):
        for j in range(nx):
            dz = az * (u[i + 1, j] - u[i, j]) if i < nz - 1 else 0.0
            dx = ax * (u[i, j + 1] - u[i, j]) if j < nx - 1 else 0.0
            misfit = u[i, j] - f[i, j]
            divergence = az * (p[i + 1, j] - p[i, j]) + ax * (q[i, j + 1] - q[i, j])
            energy += 0.5 * w[i, j] * misfit * misfit + strength * np.sqrt(dz * dz + dx * dx)
            energy += 0.5 * divergence * divergence / w[i, j] + f[i, j] * divergence
            total += w[i, j]
    return energy, total


@njit(cache=True, nogil=True, error_model='numpy')
def _primal_dual(f, w, strength, az, ax, tolerance, max_iterations):  # type: ignore[no-untyped-def]
    """Return (u, error bound, iterations).

    The dual lives on faces: p[i + 1] above row i, q[:, j + 1] right of column j; the outermost
    faces stay 0.
    """
    nz, nx = f.shape
    u = f.copy()
    bar = f.copy()
    p = np.zeros((nz + 1, nx), np.float32)
    q = np.zeros((nz, nx + 1), np.float32)
    one = np.float32(1.0)
    convexity = w.min()
    norm_squared = np.float32(4.0) * (az * az + ax * ax)
    primal = one / np.sqrt(norm_squared)
    error = np.float64(np.inf)
    count = 0
    while count < max_iterations:
        for _ in range(CHECK_EVERY):
            dual = one / (norm_squared * primal)
            beyond = one / np.sqrt(one + np.float32(2.0) * convexity * primal)
            for i in range(nz):
                # the row above the top row is the top row itself: no flux, and p stays 0 there
                above = bar[min(i + 1, nz - 1)]
                _dual_row(bar[i], above, p[i + 1], q[i], dual, strength, az, ax)
                # no later row needs the old bar[i]: one pass over memory does both steps
                _primal_row(u[i], bar[i], p[i + 1], p[i], q[i], f[i], w[i], primal, beyond, az, ax)
            primal *= beyond
        count += CHECK_EVERY
        gap, total = _gap(u, p, q, f, w, strength, az, ax)
        error = np.sqrt(2.0 * max(gap, 0.0) / total)
        if error < tolerance:
            break
    return u, error, count
