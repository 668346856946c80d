"""Errors that all maps of a recording share: wrong calibration, wrong corners of the rig, blur.

Maps from photographs come with a systematic deviation in every cell. This deviation gives the size
of an error, but not its shape. For example, a wrong response makes all pale cells wrong in the same
direction. Such errors are not noise: they are a few unknown numbers, each with a pattern, its mode:

| error | mode, c the concentration | unknown numbers |
| --- | --- | --- |
| level of the stock | c | 1 |
| scale of a sand | c in that sand | one per sand |
| bend of the response | 4 c (1 - c), and the same times 1 - 2 c | 2 |
| shift of the camera | slope of c | 2 |
| place of the corners of the rig | bilinear displacement times the slope of c | 8 |
| blur | Laplacian of c | 1 |

`measured_errors` reads the standard deviation of each number from the delivered deviations, cell by
cell. Only the level of the stock has a fixed one: imaging cannot know it. `SharedErrors` takes the
modes out of a residual as far as their deviations allow.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, uniform_filter
from scipy.optimize import lsq_linear, nnls

from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.sand_interfaces import MOST_SANDS, sand_level
from porotwin_diagnosis.data.noise import TRACER_PRESENT
from porotwin_diagnosis.thresholds import INTERVAL_DEVIATIONS

MOST_VALUES = 20_000
"""Values from which the sizes of the errors are read; there are only a dozen of them."""

STOCK_LEVEL = 0.05
"""Relative deviation of the concentration that the calibration took for stock. It took the core of
a plume in the same rig. Immobile water, decay or fading light makes this core paler, and so all
maps too bright by 1 to 7 % on the virtual rig."""

SHIFT_OVER_PLACE, CORNER_OVER_PLACE = 0.8, 0.9
"""Deviations of a common shift and of a corner over the deviation of the place. A shaken baseline
shifts everything, corners are read off one by one. Of a bilinear displacement the root mean square
over the rig is 2/3 of that at a corner, so that both make 0.8^2 + (0.9 x 2/3)^2 = 1."""

SECOND_BEND = 0.7
"""Size of the second form of the bend relative to the first. A response with one bend has mostly
the first form; power laws and saturation have a part of the second."""

LOCAL_SHARE = 0.3
"""Share of the systematic deviation that no mode describes and that counts as noise: responses
that differ from sand to sand, lenses that no curvature describes. With known truths, on rendered
and on composed photographs, the modes alone leave no more than the random deviation explains."""


@dataclass(frozen=True)
class ErrorSizes:
    """Standard deviations of the errors that all maps share.

    Attributes:
        scales: relative error of the scale in each sand [-]; empty where predictions take the scale
            of the maps, with the level of the stock.
        bend: error of the concentration 0.5 [-].
        place_m: error of a place [m].
        blur_m2: error of the square of the width of the blur [m^2].
    """

    scales: tuple[float, ...]
    bend: float
    place_m: float
    blur_m2: float


def measured_errors(
    maps: FloatArray, systematic: FloatArray, sands: NDArray[np.intp], grid: Grid
) -> ErrorSizes:
    """Return the sizes of the shared errors that explain the `systematic` deviations.

    The squares of the modes are fitted to the squares of the deviations, without negative sizes.

    Args:
        maps: observed concentration [-], (nt, nz, nx), NaN where nothing is seen.
        systematic: its systematic standard deviation [-], same shape.
        sands: number of the sand of every cell, (nz, nx).
        grid: grid of the maps.
    """
    count = int(sands.max()) + 1
    known = np.isfinite(maps) & np.isfinite(systematic) & (np.nan_to_num(maps) > TRACER_PRESENT)
    cells = np.flatnonzero(known)
    if not cells.size:
        return ErrorSizes((0.0,) * count, 0.0, 0.0, 0.0)
    cells = cells[:: max(1, cells.size // MOST_VALUES)]
    filled = np.nan_to_num(maps)
    slope_z, slope_x, bend = derivatives(filled, grid)
    c = filled.ravel()[cells]
    sand = np.broadcast_to(sands, maps.shape).ravel()[cells]
    shapes = [
        *(np.where(sand == number, c, 0.0) ** 2 for number in range(count)),
        (4.0 * c * (1.0 - c)) ** 2,
        _around(slope_z**2 + slope_x**2).ravel()[cells],
        _around((0.5 * bend) ** 2).ravel()[cells],
    ]
    squares = np.stack(shapes, axis=1)
    unit = np.maximum(np.sqrt(np.mean(squares**2, axis=0)), 1e-30)
    found, _ = nnls(squares / unit, systematic.ravel()[cells].astype(float) ** 2)
    sizes = np.sqrt(found / unit)
    return ErrorSizes(
        tuple(float(size) for size in sizes[:count]), *(float(size) for size in sizes[count:])
    )


def error_modes(
    sizes: ErrorSizes, maps: FloatArray, sands: NDArray[np.intp], grid: Grid
) -> FloatArray:
    """Return the modes (k, nt, nz, nx) [-]: changes of the maps by one standard deviation.

    Args:
        sizes: standard deviations of the errors.
        maps: concentration [-], (nt, nz, nx), without NaN.
        sands: number of the sand of every cell, (nz, nx).
        grid: grid of the maps.
    """
    slope_z, slope_x, bend = derivatives(maps, grid)
    pale = 4.0 * sizes.bend * maps * (1.0 - maps)
    shift, corner = SHIFT_OVER_PLACE * sizes.place_m, CORNER_OVER_PLACE * sizes.place_m
    right, up = grid.x / grid.width, (grid.z / grid.height)[:, None]
    shares = [a * b for a in (right, 1.0 - right) for b in (up, 1.0 - up)]
    modes = [
        *([STOCK_LEVEL * maps] if sizes.scales else []),
        *(size * maps * (sands == number) for number, size in enumerate(sizes.scales)),
        pale,
        SECOND_BEND * pale * (1.0 - 2.0 * maps),
        *(shift * slope for slope in (slope_x, slope_z)),
        *(corner * share * slope for share in shares for slope in (slope_x, slope_z)),
        0.5 * sizes.blur_m2 * bend,
    ]
    return np.stack([mode for mode in modes if mode.any()] or modes[:1])


def best_level(maps: FloatArray, observed: FloatArray) -> float:
    """Return `nearest_level` of calibrated maps: within three deviations of 1."""
    return float(
        np.clip(nearest_level(maps, observed), 1.0 - 3.0 * STOCK_LEVEL, 1.0 + 3.0 * STOCK_LEVEL)
    )


def nearest_level(maps: FloatArray, observed: FloatArray) -> float:
    """Return the factor [-] on `maps` that brings them nearest to `observed` maps (nt, nz, nx).

    NaN marks what is not seen. It is 1 where nothing tells it.
    """
    known = np.isfinite(observed)
    product = float(maps[known] @ observed[known])
    return product / float(maps[known] @ maps[known]) if product > 0.0 else 1.0


def derivatives(maps: FloatArray, grid: Grid) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return d/dz, d/dx [1/m] and the Laplacian [1/m^2] of `maps` (nt, nz, nx)."""
    slope_z, slope_x = np.gradient(maps, grid.dz, grid.dx, axis=(1, 2))
    second = (1.0, -2.0, 1.0)
    bend = correlate1d(maps, second, axis=1) / grid.dz**2
    bend += correlate1d(maps, second, axis=2) / grid.dx**2
    return np.asarray(slope_z), np.asarray(slope_x), np.asarray(bend)


def _around(squares: FloatArray) -> FloatArray:
    """Return the mean of `squares` (nt, nz, nx) over each cell and its eight neighbours.

    Delivered deviations of places and blur are such means (`map_deviation`).
    """
    return np.asarray(np.maximum(uniform_filter(squares, (1, 3, 3)), 0.0))


def sands_of(rig: Rig, grid: Grid) -> NDArray[np.intp]:
    """Return the number of the sand of every cell (nz, nx); 0 where a map has too many."""
    levels = np.unique(sand_level(rig.nominal_map('permeability_m2')))
    if not 1 < len(levels) <= MOST_SANDS:
        return np.zeros(grid.shape, dtype=np.intp)
    here = np.log(rig.field('permeability_m2', grid))
    return np.abs(here[..., None] - levels).argmin(axis=-1)


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Decorrelates whitened residuals whose errors share modes.

    With the whitened modes A (n, k) and the variance v per unknown number, residuals have the
    covariance C = I + A A^T / v. The decorrelated residual is C^(-1/2) r, of the same shape. Its
    sum of squares is the least one over all errors b, their own cost included:

        |C^(-1/2) r|^2 = min over b of |r - A b|^2 + v |b|^2.

    Attributes:
        modes: whitened modes, one array (k, ...) with the shape of a residual behind the first
            axis.
        cost: v, the sum of squares that an error of one standard deviation costs.
    """

    modes: FloatArray
    cost: float

    def decorrelated(self, residual: FloatArray) -> FloatArray:
        """Return C^(-1/2) `residual`, of the same shape as one mode."""
        flat = self._flat
        taken = flat.T @ (self._share @ (flat @ residual.ravel()))
        return np.asarray(residual - taken.reshape(residual.shape))

    def most_probable(self, residual: FloatArray) -> FloatArray:
        """Return the errors b (k,) of that least sum, in standard deviations.

        Each lies within its 90 % interval.
        """
        flat = self._flat
        root = np.linalg.cholesky(flat @ flat.T + self.cost * np.eye(len(flat)))
        wanted = np.linalg.solve(root, flat @ residual.ravel())
        bounds = (-INTERVAL_DEVIATIONS, INTERVAL_DEVIATIONS)
        return np.asarray(lsq_linear(root.T, wanted, bounds).x)

    @cached_property
    def effective_number(self) -> float:
        """Number of unknown errors that the residuals determine, sum of e / (e + v) [-].

        e are the eigenvalues of A A^T. Each of these errors costs v in the mean.
        """
        squares = np.linalg.eigvalsh(self._flat @ self._flat.T)
        return float(np.sum(squares / (squares + self.cost)))

    @cached_property
    def _flat(self) -> FloatArray:
        return self.modes.reshape(len(self.modes), -1)

    @cached_property
    def _share(self) -> FloatArray:
        """S with C^(-1/2) = I - A S A^T, (k, k), from the eigenvalues of A^T A."""
        squares, vectors = np.linalg.eigh(self._flat @ self._flat.T)
        # modes that are sums of others count once
        least = ROUND_OFF * max(float(squares.max()), self.cost)
        kept = squares > least
        squares, vectors = squares[kept], vectors[:, kept]
        shares = (1.0 - 1.0 / np.sqrt(1.0 + squares / self.cost)) / squares
        return np.asarray(vectors * shares @ vectors.T)
