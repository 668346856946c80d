"""Measures of a map: how much tracer there is, where, how far spread, and the shape of its outline.

Cells that the map does not show (NaN, infinity) count as clean. A map without any value has no
measures. The outline is the line of one concentration, `level`, interpolated linearly between the
centres of the cells. Fingers are
counted along the front of the plume on one side: for each column (or row) the front is how far the
plume reaches, and a finger is a maximum of it that stands out by `FINGER_M`. A plume without
fingers has one.

Mass, centre and spread, and distances of maps, take the cells of the plume alone (`plume_alone`).
The noise of clean sand is small in each cell, but it fills the rig: its moments would outweigh
those of a small plume. A map that shows noise alone has no tracer and no centre.

Deviations are carried through at first order. The random part is correlated between neighbours like
the noise of clean sand far from the plume. The systematic part is common to all cells. Half the
range over other choices of the plume's edge adds to both. Where a value has no deviation, the
deviations of the measures are not known.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label, maximum
from scipy.signal import find_peaks

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS

Array = NDArray[Any]

Side = Literal['down', 'up', 'left', 'right']
SIDES: tuple[Side, ...] = ('down', 'up', 'left', 'right')
"""Sides of the plume where fingers are counted."""

FINGER_M = 0.01
"""A finger reaches further than the places beside it by at least this [m], and by two cells."""
LEAST_INSIDE = 0.02
"""Least concentration of the plume's inside [-], for maps of unknown or tiny deviation. In maps
without noise, as a model makes them, it counts relative to the peak: a pale plume is one too."""
NOISE_FREE = 2e-3
"""Noise over the peak of a map below which it has none [-]; photographs have ten times as much."""
MARGIN_M = 0.03
"""The pale rim of the plume reaches this far beyond its inside [m]: a few widths of dispersion."""
SMALLEST_PART = 4
"""Smaller parts of cells are noise: denoised noise makes spots of a few cells."""
NOISE_SHARE = 0.9
"""The noise of clean sand is the value that this share of its cells stays below [-]."""
CORE_NOISES = 25.0
"""A plume's peak exceeds that noise by this factor [-]: spots of denoised noise reach 17."""
PALE_M2 = 2.5e-3
"""A larger part is a plume without such a peak [m^2]: spots of noise have up to 3 cm^2."""
OTHER_EDGES = ((2.0, 0.5), (1.0, 2.0))
"""Other edges of a plume, for deviations: factors of the inside's level and of the margin [-]."""
LEAST_NOISE = 1e-4
"""Clean sand with less noise than this has none to learn a correlation from [-]."""
FEWEST_CLEAN = 200
"""Fewest clean cells that tell the correlation of noise."""
_FINGER_CELLS = 2


@dataclass(frozen=True)
class PlumeMeasures:
    """Measures of one map; lengths are NaN where there is no tracer, all where nothing is seen.

    Attributes:
        tracer_ml: tracer in the pores of the plume and its margin, as stock [ml].
        x_m, z_m: centre of mass [m].
        spread_x_m, spread_z_m: standard deviation of the mass along x and z [m].
        spread_xz: correlation of both [-]: positive if the plume leans to the upper right.
        area_m2: area above the level [m^2].
        contour_m: length of the outline [m].
        fingers: fingers on one side.
        seen: share of the cells with pores that the map shows [-].
        tracer_deviation_ml, x_deviation_m, z_deviation_m, spread_x_deviation_m,
            spread_z_deviation_m, area_deviation_m2: standard deviations of these; NaN if a value
            that is seen has no deviation. Without a plume, that of the tracer is half of what was
            left out as noise.
    """

    tracer_ml: float
    x_m: float
    z_m: float
    spread_x_m: float
    spread_z_m: float
    spread_xz: float
    area_m2: float
    contour_m: float
    fingers: float
    seen: float
    tracer_deviation_ml: float = np.nan
    x_deviation_m: float = np.nan
    z_deviation_m: float = np.nan
    spread_x_deviation_m: float = np.nan
    spread_z_deviation_m: float = np.nan
    area_deviation_m2: float = np.nan


def plume_measures(
    values: Array,
    grid: Grid,
    pore_volume: Array,
    *,
    level: float = PLUME_THRESHOLD,
    side: Side = 'down',
    deviation: Array | None = None,
    systematic: Array | None = None,
) -> PlumeMeasures:
    """Return the measures of a concentration map.

    Args:
        values: concentration, shape (nz, nx), NaN where it is not seen.
        grid: the grid of the map.
        pore_volume: volume of the pores of each cell [m^3], shape (nz, nx).
        level: concentration of the outline [-].
        side: the side on which fingers are counted.
        deviation: standard deviation of each value, shape (nz, nx), or None.
        systematic: the part of it that is common to all cells, same shape; None: no such part.

    Raises:
        InputError: the level is not between 0 and 1, or the side is unknown.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f'level {level:g}: the outline needs a concentration between 0 and 1')
    if side not in SIDES:
        raise InputError(f"side '{side}': fingers are counted {', '.join(SIDES)}")
    values = np.where(np.isfinite(values), np.asarray(values, dtype=float), np.nan)
    seen = np.isfinite(values)
    if not seen.any():
        return _NOTHING_SEEN
    shown = np.nan_to_num(values)
    plume = plume_cells(values, grid, deviation)
    mass, centre, spread = moments = _moments(shown, plume, pore_volume, grid)
    found: dict[str, float] = {}
    common = np.zeros_like(shown) if systematic is None else systematic
    if deviation is not None and _known(deviation, seen) and _known(common, seen):
        common, total = np.where(seen, common, 0.0), np.where(seen, deviation, 0.0)
        own = np.sqrt(np.maximum(total**2 - common**2, 0.0))
        volume = np.where(plume, pore_volume, 0.0) * 1e6
        noise = _noise_spectrum(values, plume, grid)
        found = _deviations(own, common, noise, volume, grid, moments)
        others = [
            plume_cells(values, grid, deviation, edge=edge) if plume.any() else shown > LEAST_INSIDE
            for edge in OTHER_EDGES
        ]
        found = _with_edges(
            found, moments, [_moments(shown, cells, pore_volume, grid) for cells in others]
        )
        area = _area(shown + total, level, grid) - _area(shown - total, level, grid)
        found['area_deviation_m2'] = 0.5 * area
    return PlumeMeasures(
        tracer_ml=float(mass.sum()),
        x_m=centre[0],
        z_m=centre[1],
        spread_x_m=spread[0],
        spread_z_m=spread[1],
        spread_xz=spread[2],
        area_m2=_area(shown, level, grid),
        contour_m=contour_length(values, grid, level),
        fingers=finger_count(values, grid, level, side),
        seen=float(seen[pore_volume > 0.0].mean()),
        **found,
    )


_NOTHING_SEEN = PlumeMeasures(
    np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, fingers=np.nan, seen=0.0
)


def _known(deviation: Array, seen: Array) -> bool:
    """Return whether every value that is seen has a deviation: finite, not negative."""
    part = np.asarray(deviation)[seen]
    return bool((np.isfinite(part) & (part >= 0.0)).all())


def plume_cells(
    values: Array,
    grid: Grid,
    deviation: Array | None = None,
    *,
    edge: tuple[float, float] = (1.0, 1.0),
) -> Array:
    """Return the cells that belong to the plume of a map (nz, nx): its inside and a margin.

    The inside lies above `LEAST_INSIDE` and above `NOISE_SPREADS` typical deviations of clean
    sand, in parts of at least `SMALLEST_PART` cells. Each part has a peak above `CORE_NOISES` times
    the noise of clean sand, at most the outline's, or an area above `PALE_M2`: others are noise.
    The margin is `MARGIN_M` wide. Small parts count where there is nothing else: a plume begins
    with one cell.

    Args:
        values: concentration, shape (nz, nx), NaN where it is not seen.
        grid: the grid of the map.
        deviation: standard deviation of each value, shape (nz, nx), or None.
        edge: factors of the level of the inside and of the width of the margin [-].
    """
    shown = np.nan_to_num(values)
    noisy = deviation is not None and bool(np.nanmax(deviation, initial=0.0) > 0.0)
    level = least = LEAST_INSIDE if noisy else _least_inside(shown, np.isfinite(values))
    if deviation is not None:
        clean = np.asarray(deviation)[(shown < PLUME_THRESHOLD) & np.isfinite(deviation)]
        if clean.size:
            level = min(max(level, NOISE_SPREADS * float(np.median(clean))), PLUME_THRESHOLD)
    inside = _without_noise(shown > edge[0] * level, shown, np.isfinite(values), grid, least)
    if not inside.any():
        return inside
    away = distance_transform_edt(~inside, (grid.dz, grid.dx))
    return np.asarray(away <= edge[1] * MARGIN_M)


def _least_inside(shown: Array, seen: Array) -> float:
    """Return the least concentration of the plume's inside [-] in a map; see `LEAST_INSIDE`."""
    peak = float(shown.max(initial=0.0))
    clean = shown[seen & (shown < PLUME_THRESHOLD * peak)]
    pale = shown[seen & (shown > 0.0)]
    if pale.size > SMALLEST_PART and pale.min() >= PLUME_THRESHOLD * peak:
        return LEAST_INSIDE  # the steps of packed values hide noise
    if not clean.size or np.quantile(np.abs(clean), NOISE_SHARE) > NOISE_FREE * peak:
        return LEAST_INSIDE
    return LEAST_INSIDE * min(peak, 1.0)


def _without_noise(inside: Array, shown: Array, seen: Array, grid: Grid, least: float) -> Array:
    """Return the cells `inside` without the parts that are noise, see `plume_cells`."""
    parts, count = label(inside, np.ones((3, 3)))
    if not count:
        return inside
    numbers = np.arange(1, count + 1)
    sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:]
    clean = shown[seen & (shown < least)]
    noise = float(np.quantile(clean, NOISE_SHARE)) if clean.size else 0.0
    core = min(max(least, CORE_NOISES * noise), PLUME_THRESHOLD)
    kept = (maximum(shown, parts, numbers) > core) | (sizes * grid.cell_area > PALE_M2)
    large = kept & (sizes >= SMALLEST_PART)
    return np.asarray(np.concatenate([[False], large if large.any() else kept])[parts])


def plume_alone(values: Array, grid: Grid, deviation: Array | None = None) -> Array:
    """Return a map (nz, nx) whose clean sand is 0; arguments as of `plume_cells`."""
    outside = ~plume_cells(values, grid, deviation) & np.isfinite(values)
    return np.where(outside, 0.0, values)


def contour_length(values: Array, grid: Grid, level: float = PLUME_THRESHOLD) -> float:
    """Return the length [m] of the lines of the concentration `level` in a map (nz, nx).

    Lines end at cells that are not seen; the edge of the rig is no outline.
    """
    if min(grid.shape) < 2:
        return 0.0
    seen = np.ma.masked_invalid(np.asarray(values, dtype=float))
    lines = contour_generator(grid.x, grid.z, seen).lines(level)
    steps = (np.diff(np.asarray(line, dtype=float), axis=0) for line in lines)
    return float(sum(np.hypot(*step.T).sum() for step in steps))


def finger_count(
    values: Array, grid: Grid, level: float = PLUME_THRESHOLD, side: Side = 'down'
) -> int:
    """Return the number of fingers of the plume above `level` on one side of a map (nz, nx)."""
    above = np.nan_to_num(values) >= level
    size, across = (grid.dz, above) if side in ('down', 'up') else (grid.dx, above.T)
    if side in ('up', 'right'):
        across = across[::-1]
    # the distance from the far side of the plume to its front, in each column
    rows = np.flatnonzero(across.any(axis=1))
    if not rows.size:
        return 0
    front = np.where(across.any(axis=0), rows[-1] + 1 - np.argmax(across, axis=0), 0)
    prominence = max(_FINGER_CELLS, FINGER_M / size)
    # peaks of equal height would all stand out over the whole plume: the last one is the highest
    ranked = front + np.linspace(0.0, 0.5, front.size)
    peaks, _ = find_peaks(np.pad(ranked, 1), prominence=prominence - 0.5)
    return max(1, len(peaks))


def _centre(mass: Array, grid: Grid) -> tuple[float, float]:
    """Return the centre (x, z) of mass [m]; NaN without mass."""
    total = mass.sum()
    if not total > 0.0:
        return np.nan, np.nan
    x, z = mass.sum(axis=0) @ grid.x / total, mass.sum(axis=1) @ grid.z / total
    if not (0.0 <= x <= grid.width and 0.0 <= z <= grid.height):
        return np.nan, np.nan
    return float(x), float(z)


def _spread(mass: Array, grid: Grid, centre: tuple[float, float]) -> tuple[float, float, float]:
    """Return the standard deviations along x and z [m], and their correlation."""
    if np.isnan(centre[0]):
        return np.nan, np.nan, np.nan
    total = mass.sum()
    x, z = grid.x - centre[0], grid.z - centre[1]
    along_x = _root(mass.sum(axis=0) @ x**2 / total)
    along_z = _root(mass.sum(axis=1) @ z**2 / total)
    both = along_x * along_z
    return along_x, along_z, float(z @ mass @ x / total / both) if both > 0.0 else np.nan


def _root(variance: float) -> float:
    """Return the square root; NaN of a negative variance, which noise below 0 can make."""
    return float(np.sqrt(variance)) if variance >= 0.0 else np.nan


def _area(shown: Array, level: float, grid: Grid) -> float:
    """Return the area above `level` [m^2]."""
    return float((shown >= level).sum() * grid.cell_area)


def _moments(shown: Array, plume: Array, pore_volume: Array, grid: Grid) -> 'Moments':
    """Return the mass of each cell [ml], its centre and its spread [m]."""
    mass = np.where(plume, shown, 0.0) * pore_volume * 1e6
    centre = _centre(mass, grid)
    return mass, centre, _spread(mass, grid, centre)


Moments = tuple[Array, tuple[float, float], tuple[float, float, float]]
"""Mass of each cell [ml]; centre (x, z) [m]; spread along x and z [m], and their correlation."""


def _deviations(
    own: Array, common: Array, noise: Array, volume: Array, grid: Grid, moments: Moments
) -> dict[str, float]:
    """Return the standard deviations of the mass [ml], of its centre and of its spread [m]."""

    def of_sum(weight: Array) -> float:
        power = np.abs(np.fft.rfft2(weight * own, _padded(grid))) ** 2
        power[:, 1:-1] *= 2.0  # the half of the spectrum that a real transform leaves out
        correlated = max(float((power * noise).sum()) / np.prod(_padded(grid)), 0.0)
        return float(np.hypot(np.sqrt(correlated), np.sum(weight * common)))

    mass, centre, spread = moments
    found = {'tracer_deviation_ml': of_sum(volume)}
    if np.isnan(centre[0]):
        return found
    places = ('x', (grid.x - centre[0])[None, :]), ('z', (grid.z - centre[1])[:, None])
    for (axis, away), wide in zip(places, spread[:2], strict=True):
        share = volume / mass.sum()
        found[f'{axis}_deviation_m'] = of_sum(share * away)
        if wide > 0.0:
            found[f'spread_{axis}_deviation_m'] = of_sum(share * (away**2 - wide**2) / (2.0 * wide))
    return found


def _padded(grid: Grid) -> tuple[int, int]:
    """Return an even shape in which shifted maps do not wrap onto themselves."""
    return 2 * grid.nz, 2 * grid.nx


def _noise_spectrum(values: Array, plume: Array, grid: Grid) -> Array:
    """Return the spectrum of the correlation of noise between cells; 1 without any correlation.

    The noise is that of cells further than twice `MARGIN_M` from the plume. Cells further than
    `MARGIN_M` from each other are not correlated.
    """
    shape = _padded(grid)
    independent = np.ones((shape[0], shape[1] // 2 + 1))
    clean = np.isfinite(values)
    if plume.any():
        clean &= distance_transform_edt(~plume, (grid.dz, grid.dx)) > MARGIN_M
    if clean.sum() < FEWEST_CLEAN:
        return independent
    noise = np.where(clean, np.nan_to_num(values) - values[clean].mean(), 0.0)
    if noise[clean].std() < LEAST_NOISE:
        return independent
    pairs, products = (
        np.fft.irfft2(np.abs(np.fft.rfft2(field, shape)) ** 2, shape)
        for field in (clean.astype(float), noise)
    )
    lag_z, lag_x = np.fft.fftfreq(shape[0], 1 / shape[0]), np.fft.fftfreq(shape[1], 1 / shape[1])
    near = np.hypot(lag_z[:, None] * grid.dz, lag_x[None, :] * grid.dx) <= MARGIN_M
    covariance = np.where(near & (pairs > 0.5), products / np.maximum(pairs, 0.5), 0.0)
    return np.fft.rfft2(covariance / covariance[0, 0], shape).real


def _with_edges(
    found: dict[str, float], moments: Moments, others: list[Moments]
) -> dict[str, float]:
    """Return the deviations, each with half the range over other edges of the plume."""

    def measures(of: Moments) -> dict[str, float]:
        mass, centre, spread = of
        return {
            'tracer_deviation_ml': float(mass.sum()),
            'x_deviation_m': centre[0],
            'z_deviation_m': centre[1],
            'spread_x_deviation_m': spread[0],
            'spread_z_deviation_m': spread[1],
        }

    every = [measures(one) for one in (moments, *others)]
    ranges = {
        name: np.nanmax([one[name] for one in every]) - np.nanmin([one[name] for one in every])
        for name in found
    }
    return {name: float(np.hypot(value, 0.5 * ranges[name])) for name, value in found.items()}
