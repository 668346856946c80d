"""The Wasserstein distance between two maps: how far tracer must move to turn one into another.

W1 of two distributions of mass 1 is the least mean distance over which mass is carried. A plume
that moves by 0.1 m has the distance 0.1 m, whatever its shape. Cell-wise errors do not tell a small
shift from a large one as soon as the plumes no longer overlap. With rho = second - first,
Beckmann's problem on the grid of the maps is

    W1 = min sum |q|  with  div q = -rho    (q: mass times length, flowing between the cells)
       = max sum phi rho  with  |grad phi| <= 1.

Douglas-Rachford splitting solves it: |q| shrinks cell by cell, and a cosine transform projects onto
the balance of mass. Every q in balance bounds the distance from above, every phi of slope at most 1
from below, so that the result is known to within `TOLERANCE`. A network simplex (POT, OR-tools)
needs the distances between all pairs of cells: 14 GB for 280 x 150 cells.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.smoothing.total_variation import CHECK_EVERY

Array = NDArray[Any]

TOLERANCE = 0.005
"""Relative distance of the two bounds at which the iteration stops [-]."""
MOST_CELLS = 50_000
"""Finer maps are averaged over blocks of cells: distances need no finer ones."""
_MOST_ITERATIONS = 3000
_STEP = 4.0
"""Step of the splitting relative to the mean flow; fastest on shifted, split and spread plumes."""


@dataclass(frozen=True)
class MapDistance:
    """The distance between two maps.

    Attributes:
        distance_m: W1 between the normalised maps [m], the middle between its bounds; NaN if one
            holds no tracer.
        bound_m: the true distance on the grid is within this of `distance_m` [m].
        mass_change: mass of the second map over that of the first, minus 1 [-]; NaN if the first
            holds none.
    """

    distance_m: float
    bound_m: float
    mass_change: float


def map_distance(
    first: Array, second: Array, grid: Grid, volume: Array | None = None
) -> MapDistance:
    """Return the distance between two maps (nz, nx) on `grid`.

    Cells that one of the maps does not show (NaN) count in neither. `volume` (nz, nx) weighs the
    cells, such as `Rig.cell_pore_volume`; None: all alike.
    """
    weight = np.ones(grid.shape) if volume is None else volume
    seen = np.isfinite(first) & np.isfinite(second)
    masses = [np.where(seen, np.maximum(one, 0.0), 0.0) * weight for one in (first, second)]
    before, after = (float(mass.sum()) for mass in masses)
    if before <= 0.0 or after <= 0.0:
        return MapDistance(np.nan, np.nan, after / before - 1.0 if before > 0.0 else np.nan)
    change, spacing = _coarser(masses[1] / after - masses[0] / before, grid)
    low, high = _bounds(change, spacing)
    return MapDistance(0.5 * (low + high), 0.5 * (high - low), after / before - 1.0)


def _coarser(change: Array, grid: Grid) -> tuple[Array, tuple[float, float]]:
    """Return the change of mass on about `MOST_CELLS` cells at most, and their size (dz, dx)."""
    across = max(1, int(np.ceil(np.sqrt(change.size / MOST_CELLS))))
    nz, nx = (int(np.ceil(count / across)) for count in change.shape)
    sums = cv2.resize(change, (nx, nz), interpolation=cv2.INTER_AREA) * (change.size / (nz * nx))
    return np.asarray(sums), (grid.height / nz, grid.width / nx)


def _bounds(change: Array, spacing: tuple[float, float]) -> tuple[float, float]:
    """Return a lower and an upper bound on W1 [m] for a change of mass (nz, nx) with the sum 0."""
    if not change.any():
        return 0.0, 0.0
    operators = _Operators(change.shape, spacing)
    flow = operators.balanced(np.zeros((2, *change.shape)), change)
    step = _STEP * float(np.hypot(*flow).mean())
    start = flow
    low, high = 0.0, float(np.hypot(*flow).sum())
    for iteration in range(1, _MOST_ITERATIONS + 1):
        length = np.hypot(*start)
        shrunk = start * (np.maximum(length - step, 0.0) / np.maximum(length, step))
        flow = operators.balanced(2.0 * shrunk - start, change)
        if iteration % CHECK_EVERY == 0:
            high = min(high, float(np.hypot(*flow).sum()))
            low = max(low, operators.lower_bound((start - shrunk) / step, change))
            if high - low <= TOLERANCE * high:
                break
        start = start + flow - shrunk
    return low, high


class _Operators:
    """Gradient, divergence and Poisson's equation on a grid without flow through its edges."""

    def __init__(self, shape: tuple[int, ...], spacing: tuple[float, float]) -> None:
        self.spacing = spacing
        nz, nx = shape
        squares = [
            (2.0 * np.cos(np.pi * np.arange(count) / count) - 2.0) / size**2
            for count, size in zip((nz, nx), spacing, strict=True)
        ]
        self._eigenvalues = squares[0][:, None] + squares[1][None, :]
        self._eigenvalues[0, 0] = np.inf  # the constant has no gradient

    def gradient(self, field: Array) -> Array:
        """Return the gradient (2, nz, nx), upward and to the right; 0 at the last cells."""
        slope = np.zeros((2, *field.shape))
        slope[0, :-1] = (field[1:] - field[:-1]) / self.spacing[0]
        slope[1, :, :-1] = (field[:, 1:] - field[:, :-1]) / self.spacing[1]
        return slope

    def divergence(self, flow: Array) -> Array:
        """Return the divergence (nz, nx), the negative adjoint of `gradient`."""
        up, right = flow[0] / self.spacing[0], flow[1] / self.spacing[1]
        out = np.zeros(up.shape)
        out[:-1] += up[:-1]
        out[1:] -= up[:-1]
        out[:, :-1] += right[:, :-1]
        out[:, 1:] -= right[:, :-1]
        return out

    def potential(self, source: Array) -> Array:
        """Return the field (nz, nx) whose gradient has the divergence `source`."""
        return np.asarray(idctn(dctn(source, type=2) / self._eigenvalues, type=2))

    def balanced(self, flow: Array, change: Array) -> Array:
        """Return the flow (2, nz, nx) nearest to `flow` whose divergence is -`change`."""
        balanced = flow + self.gradient(self.potential(-change - self.divergence(flow)))
        balanced[0, -1] = 0.0
        balanced[1, :, -1] = 0.0
        return np.asarray(balanced)

    def lower_bound(self, slope: Array, change: Array) -> float:
        """Return the lower bound of the potential whose gradient is nearest to `slope`."""
        field = self.potential(self.divergence(slope))
        steepest = float(np.hypot(*self.gradient(field)).max())
        return float((field * change).sum()) / max(steepest, 1e-12)
