"""Weighted total-variation denoising after Rudin, Osher and Fatemi (paper, sec. 2.2.1).

The result is the map u that minimises

    1/2 int w (u - f)^2 dA + weight_m int |grad u| dA

for data f and data weights w between 0 and 1. Data without weight are first filled in from their
surroundings. The total variation weight is a length [m per unit of f] and independent of the
resolution: a disc of radius r keeps its shape and loses 2 weight_m / r of its height. Its value is
`TotalVariationSettings.weight_m`.

The discrete problem (forward differences, no flux at the edges) is solved by the accelerated
primal-dual method of Chambolle and Pock (J. Math. Imaging Vision 40:120, 2011, algorithm 2). Its
map u and its dual variable p approach the minimiser u* from two sides: the map that p stands for is
v = f + div p / w. The duality gap G bounds both distances,

    1/2 int w (u - u*)^2 dA + 1/2 int w (v - u*)^2 dA <= G,

because the primal problem is strongly convex in u and the dual one in div p. With norms weighted by
w, u* therefore lies in a ball around the mean of u and v (parallelogram law), and

    |u - u*| <= 1/2 |u - v| + sqrt(G - 1/4 |u - v|^2),

which is up to 1.4 times less than sqrt(2 G). The iteration stops when this bound, relative to the
square root of int w dA, is below the tolerance: a weighted root mean square error.

Large maps are solved on tiles. Most tiles show clean sand, whose minimiser is constant: u* is the
weighted mean of f, and p the gradient of a potential phi with the Laplacian w (u* - f). A cosine
transform gives phi at once. Where |p| stays within the total variation weight, its bound is below
the tolerance and no iteration is needed.

The kernels keep to the order of operations as written. Faster rounding (numba's `fastmath`) would
save nothing here, and maps would depend on whether a kernel was compiled now or earlier.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import dctn, idctn

from porotwin_imaging.numerics.row_bands import by_bands


@dataclass(frozen=True)
class TotalVariationSettings:
    """Denoising by total variation (`total_variation.py`)."""

    weight_m: float = 1e-4
    """Total variation weight [m]: a disc of radius r loses 2 weight / r of its height. At 0.1 mm a
    plume of 2 cm radius loses 1 %."""
    tolerance: float = 4e-3
    """Accepted root mean square distance from the exact minimiser [-]; less costs iterations."""
    most_iterations: int = 1000
    """The iteration stops here even if the tolerance is not reached."""
    least_data_weight: float = 0.05
    """Data weights are raised to this [-]. The accelerated method needs strong convexity."""
    tiled_from_cells: int = 1_000_000
    """Maps with more cells are solved in tiles."""
    tile_cells: int = 256
    """Side of a tile [cells]: its overlap costs a third, its arrays nearly fit a core's cache."""
    halo_cells: int = 24
    """Overlap of neighbouring tiles [cells]; cells further away hardly influence each other."""
    threads: int = 2
    """Threads that solve tiles at the same time."""


TOTAL_VARIATION = TotalVariationSettings()


Array = NDArray[Any]

CHECK_EVERY = 10
"""Iterations between two evaluations of the bound, which costs about two iterations."""
_CONVEXITY = 0.35
"""Strong convexity that the acceleration assumes, relative to the mean data weight. The smallest
data weight would be safe, and takes twice the iterations where few cells are uncertain. The bound
holds with any value."""
_SMALLEST_LEVEL = 4
"""Rows or columns below which the filling pyramid ends."""


@dataclass(frozen=True)
class DenoisedMap:
    """The result of the denoising.

    Attributes:
        values: the map, float32, shape (nz, nx).
        error: bound on its weighted root mean square distance from the exact minimiser.
        iterations: iterations of the primal-dual method.
    """

    values: Array
    error: float
    iterations: int


def total_variation_denoising(
    data: Array,
    data_weights: Array,
    *,
    spacing: tuple[float, float],
    settings: TotalVariationSettings = TOTAL_VARIATION,
) -> DenoisedMap:
    """Return the weighted total-variation minimiser.

    Args:
        data: noisy map, shape (nz, nx); NaN counts as data without weight.
        data_weights: weight of each cell from 0 to 1, same shape.
        spacing: size (dz, dx) of a cell [m].
        settings: total variation weight, tolerance and limits.
    """
    (weight,) = by_bands(
        lambda data, weights: (
            np.where(np.isfinite(data), np.clip(weights, 0.0, 1.0), 0.0).astype(np.float32),
        ),
        data,
        data_weights,
    )
    filled = fill(data, weight, settings)
    if settings.weight_m <= 0.0:
        return DenoisedMap(filled, 0.0, 0)
    unit = min(spacing)
    constants = (
        np.float32(settings.weight_m / unit),
        np.float32(unit / spacing[0]),
        np.float32(unit / spacing[1]),
        np.float32(settings.tolerance),
        settings.most_iterations,
    )
    weight = np.maximum(weight, np.float32(settings.least_data_weight))
    if filled.size > settings.tiled_from_cells:
        return _in_tiles(filled, weight, constants, settings)
    u, error, iterations = _primal_dual(filled, weight, *constants)
    return DenoisedMap(u, float(error), int(iterations))


def _in_tiles(
    data: Array, weight: Array, constants: tuple[Any, ...], settings: TotalVariationSettings
) -> DenoisedMap:
    """Return the minimiser of a large map, solved on overlapping tiles.

    A tile fits into the cache of a core, and tiles without tracer need few iterations. Cells beyond
    the overlap hardly influence a cell, because all cells between them must fit their own data.
    """
    nz, nx = data.shape
    tile, halo = settings.tile_cells, settings.halo_cells
    values = np.empty_like(data)

    def solve(start: tuple[int, int]) -> tuple[float, int]:
        low = [max(0, s - halo) for s in start]
        outer = tuple(
            slice(a, min(size, s + tile + halo))
            for a, s, size in zip(low, start, (nz, nx), strict=True)
        )
        f, w = (np.ascontiguousarray(field[outer]) for field in (data, weight))
        u, error = _constant(f, w, *constants[:3])
        iterations = 0
        if error >= constants[3]:
            u, error, iterations = _primal_dual(f, w, *constants)
        target = tuple(slice(s, s + tile) for s in start)
        shape = values[target].shape
        inner = tuple(slice(s - a, s - a + n) for s, a, n in zip(start, low, shape, strict=True))
        values[target] = u[inner]
        return float(error), int(iterations)

    starts = [(i, j) for i in range(0, nz, tile) for j in range(0, nx, tile)]
    with ThreadPoolExecutor(settings.threads) as pool:
        errors, iterations = zip(*pool.map(solve, starts), strict=True)
    return DenoisedMap(values, max(errors), max(iterations))


def _constant(
    f: Array, w: Array, strength: np.float32, az: np.float32, ax: np.float32
) -> tuple[Array, float]:
    """Return the constant map nearest to `f` (nz, nx), and the bound on its error."""
    total = float(w.sum())
    u = np.full_like(f, float((w * f).sum()) / total)
    waves = dctn(w * (u - f), norm='ortho')
    waves[0, 0] = 0.0
    steps_z, steps_x = (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in f.shape)
    laplacian = -(az**2 * steps_z[:, None] + ax**2 * steps_x)
    laplacian[0, 0] = 1.0
    potential = idctn(waves / laplacian.astype(np.float32), norm='ortho')
    p = np.zeros((f.shape[0] + 1, f.shape[1]), np.float32)
    q = np.zeros((f.shape[0], f.shape[1] + 1), np.float32)
    p[1:-1], q[:, 1:-1] = az * np.diff(potential, axis=0), ax * np.diff(potential, axis=1)
    _project(p, q, strength)
    return u, float(_bound(u, p, q, f, w, strength, az, ax) / np.sqrt(total))


@njit(cache=True, nogil=True, error_model='numpy')
def _project(p, q, strength):  # type: ignore[no-untyped-def]
    """Shorten the dual variable (p above, q to the right of a cell) to the length `strength`."""
    one = np.float32(1.0)
    for i in range(q.shape[0]):
        for j in range(p.shape[1]):
            a, b = p[i + 1, j], q[i, j + 1]
            scale = one / max(one, np.sqrt(a * a + b * b) / strength)
            p[i + 1, j] = a * scale
            q[i, j + 1] = b * scale


def fill(
    data: Array, weight: Array, settings: TotalVariationSettings = TOTAL_VARIATION
) -> NDArray[np.float32]:
    """Return `data` (nz, nx) with cells of little weight filled from their surroundings.

    A pyramid of weighted means: a cell combines its own level, as far as its weight allows, with
    the coarser level (pull-push, Gortler et al., SIGGRAPH 1996).
    """
    (weighted,) = by_bands(
        lambda data, weight: (
            (np.where(np.isfinite(data), data, 0.0) * weight).astype(np.float32),
        ),
        data,
        weight,
    )
    return _filled(weighted, weight, np.float32(settings.least_data_weight))


def _filled(weighted: Array, weight: Array, full_weight: np.float32) -> NDArray[np.float32]:
    """Return one level of the pyramid from weighted data and weights; `full_weight` counts as 1."""
    rows, columns = weight.shape
    if min(rows, columns) < _SMALLEST_LEVEL or weight.min() >= full_weight:
        total = float(weight.sum())
        mean = float(weighted.sum()) / total if total > 0 else 0.0
        coarser: Array = np.broadcast_to(np.float32(mean), weight.shape)
    else:
        half = ((columns + 1) // 2, (rows + 1) // 2)
        coarse = _filled(
            cv2.resize(weighted, half, interpolation=cv2.INTER_AREA),
            cv2.resize(weight, half, interpolation=cv2.INTER_AREA),
            full_weight,
        )
        coarser = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR)

    def combined(weighted: Array, weight: Array, coarser: Array) -> tuple[Array]:
        full = np.minimum(weight / full_weight, 1.0)
        own = weighted / np.maximum(weight, 1e-6)
        return ((full * own + (1.0 - full) * coarser).astype(np.float32),)

    return by_bands(combined, weighted, weight, coarser)[0]


@njit(cache=True, nogil=True, error_model='numpy')
def dual_row(here, above, p, q, step, strength, az, ax):  # type: ignore[no-untyped-def]
    """Dual step along one row: (p, q) <- projection of (p, q) + step grad u."""
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


@njit(cache=True, nogil=True, error_model='numpy')
def primal_row(u, bar, p, below, q, f, w, step, beyond, az, ax):  # type: ignore[no-untyped-def]
    """Primal step along one row: u <- prox(u + step div (p, q)), and its extrapolation."""
    one = np.float32(1.0)
    for j in range(u.size):
        divergence = az * (p[j] - below[j]) + ax * (q[j + 1] - q[j])
        old = u[j]
        weighted = step * w[j]
        new = (old + step * divergence + weighted * f[j]) / (one + weighted)
        u[j] = new
        bar[j] = new + beyond * (new - old)


@njit(cache=True, nogil=True, error_model='numpy')
def _iterate(u, bar, p, q, f, w, steps, strength, az, ax):  # type: ignore[no-untyped-def]
    """Do one iteration with `steps` (dual step, primal step, extrapolation)."""
    nz = u.shape[0]
    dual, primal, beyond = steps
    for i in range(nz):
        # no flux through the top edge: the row above is the top row, and p stays 0
        above = bar[min(i + 1, nz - 1)]
        dual_row(bar[i], above, p[i + 1], q[i], dual, strength, az, ax)
        # no later row needs the old bar[i], so that one pass does both steps
        primal_row(u[i], bar[i], p[i + 1], p[i], q[i], f[i], w[i], primal, beyond, az, ax)


@njit(cache=True, nogil=True, error_model='numpy')
def bound_row(apart, slack, u, above, p, below, q, f, w, strength, az, ax):  # type: ignore[no-untyped-def]
    """Add the terms of 1/4 |u - v|^2 and of G - 1/2 |u - v|^2 along one row, column by column."""
    quarter = np.float32(0.25)
    for j in range(u.size):
        divergence = az * (p[j] - below[j]) + ax * (q[j + 1] - q[j])
        difference = u[j] - f[j] - divergence / w[j]
        apart[j] += quarter * w[j] * difference * difference
    for j in range(u.size - 1):
        dz = az * (above[j] - u[j])
        dx = ax * (u[j + 1] - u[j])
        slack[j] += strength * np.sqrt(dz * dz + dx * dx) - (p[j] * dz + q[j + 1] * dx)
    j = u.size - 1
    dz = az * (above[j] - u[j])
    slack[j] += strength * abs(dz) - p[j] * dz


@njit(cache=True, nogil=True, error_model='numpy')
def _bound(u, p, q, f, w, strength, az, ax):  # type: ignore[no-untyped-def]
    """Return the bound of the module on |u - u*|, with sums over cells as integrals."""
    nz, nx = u.shape
    apart, slack = np.zeros(nx, np.float64), np.zeros(nx, np.float64)
    for i in range(nz):
        above = u[min(i + 1, nz - 1)]
        bound_row(apart, slack, u[i], above, p[i + 1], p[i], q[i], f[i], w[i], strength, az, ax)
    half_squared = apart.sum()
    return np.sqrt(half_squared) + np.sqrt(half_squared + max(slack.sum(), 0.0))


@njit(cache=True, nogil=True, error_model='numpy')
def _primal_dual(f, w, strength, az, ax, tolerance, max_iterations):  # type: ignore[no-untyped-def]
    """Return (u, error bound, iterations).

    The dual variable is on faces: p[i + 1] above row i, q[:, j + 1] to the right of column j. The
    outermost faces stay 0.
    """
    nz, nx = f.shape
    u = f.copy()
    bar = f.copy()
    p = np.zeros((nz + 1, nx), np.float32)
    q = np.zeros((nz, nx + 1), np.float32)
    one = np.float32(1.0)
    total = np.float64(0.0)
    for i in range(nz):
        total += w[i].sum()
    convexity = np.float32(_CONVEXITY * total / w.size)
    norm_squared = np.float32(4.0) * (az * az + ax * ax)
    primal = one / np.sqrt(norm_squared)
    error = np.float64(np.inf)
    count = 0
    while count < max_iterations:
        for _ in range(CHECK_EVERY):
            beyond = one / np.sqrt(one + np.float32(2.0) * convexity * primal)
            steps = one / (norm_squared * primal), primal, beyond
            _iterate(u, bar, p, q, f, w, steps, strength, az, ax)
            primal *= beyond
        count += CHECK_EVERY
        error = _bound(u, p, q, f, w, strength, az, ax) / np.sqrt(total)
        if error < tolerance:
            break
    return u, error, count
