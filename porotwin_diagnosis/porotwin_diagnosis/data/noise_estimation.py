"""Estimates of the noise model from the recording itself.

The grain and the frame noise in the plume come from cells where the plume is full. The background
noise comes from cells without tracer, where clipping keeps half of a normal distribution. The point
spread shows only in comparison with a model.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter
from scipy.optimize import minimize_scalar
from scipy.special import ndtri

from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.noise import (
    SMOOTHING_WIDTH,
    TRACER_PRESENT,
    Noise,
    blurred,
    normal_density,
    second_moment,
)

FULL_LEVELS = (0.9, 0.8, 0.7)
"""Levels [-] of the smoothed map above which the plume counts as full. The first one with enough
cells is used: the grain is strongest, relative to all else, where the plume is fullest."""

FALLBACK_LEVEL = 0.6
"""Level of a full plume as a share of the highest smoothed value, where no level above suffices."""

HIGHEST_QUANTILE = 0.995
"""Quantile of the smoothed maps that stands for the highest value; single outliers do not count."""

FEWEST_VALUES = 200
"""Values that an estimate needs: the relative standard error of a standard deviation from n values
is 1 / sqrt(2 n), here 5 %. The grain needs twice as many cells, since neighbours are correlated."""

MOST_CELLS = 2 / 3
"""Share of the cells at the lowest level of a full plume that is enough, where all are few: paler
cells would add little, and lie nearer to the front."""

GRAIN_MEAN_WIDTH = 3.0
"""Width [cells] of the local mean for the correlation of the grain; it must exceed the grain."""

FRONT_MARGIN = 5
"""Cells between a front and the nearest cell that counts as full or as empty."""

GRAIN_WIDTHS = np.linspace(0.3, 3.0, 271)
"""Widths [cells] that the grain may have, in steps of 0.01."""

CLIPPED = 0.999
"""Least value [-] of a cell that counts as clipped at 1; smaller ones are compared."""

MOST_CLIPPED = 0.7
"""Largest share of clipped values that noise about stock makes; half of them without an error of
the scale. Maps from photographs may be clipped to 95 % in the core of the plume. The others are
then a few odd cells, whose spread says nothing about the noise."""

OUTLIER_DEVIATIONS = 6.0
"""Changes from frame to frame above this many median changes are moving tracer, not noise."""

LEAST_CHANGE = 0.004
"""Least median change [-] for this comparison: one step of an 8-bit photograph."""

PLUME_NOISE_GUESS, FRAME_NOISE_GUESS, WIDTH_GUESS = 0.02, 0.01, 1.0
"""Noise in the plume [-], frame noise [-] and width of the grain [cells] that are assumed where a
recording has too few cells to estimate them."""

LARGEST_POINT_SPREAD = 1.2
"""Largest point spread width [cells] that is tried, twice the typical one: a softer edge is not the
work of a camera."""

DELIVERED_LEVELS = 21
"""Concentrations from 0 to 1 at which delivered deviations are kept, in steps of 0.05."""

POINT_SPREAD_TOLERANCE = 0.02
"""Tolerance [cells] of the point spread width, a thirtieth of its range."""


def measure_noise(maps: FloatArray) -> Noise:
    """Return the noise of `maps` (nt, nz, nx) [-], NaN where the image shows nothing.

    Without full cells the grain comes from the fullest cells; without empty cells the background
    noise is zero. The point spread width stays zero (see `measure_point_spread_width`).
    """
    known = np.where(np.isfinite(maps), maps, 0.0)
    smooth = np.stack([gaussian_filter(frame, SMOOTHING_WIDTH) for frame in known])
    window = (1, 2 * FRONT_MARGIN + 1, 2 * FRONT_MARGIN + 1)
    empty = (maximum_filter(smooth, window) < TRACER_PRESENT) & np.isfinite(maps)
    full = _full_cells(maps, smooth, minimum_filter(smooth, window))
    enough = np.count_nonzero(empty) > FEWEST_VALUES
    background = _half_normal_deviation(known[empty]) if enough else 0.0
    width = _grain_width(known, full)
    total = _deviation_in_plume(known, smooth, full, width)
    frame = _frame_noise(known, full)
    grain = float(np.sqrt(max(total**2 - frame**2, 0.0)))
    return Noise(grain, frame, background, width)


def add_delivered(
    noise: Noise, maps: FloatArray, deviation: FloatArray, systematic: FloatArray
) -> Noise:
    """Return `noise` with the deviations that came with `maps`, by concentration.

    Args:
        noise: the measured noise.
        maps: concentrations [-], (nt, nz, nx), NaN where nothing is seen.
        deviation: their standard deviations [-], same shape.
        systematic: their part that is equal in all maps [-], same shape.
    """
    known = np.isfinite(maps) & np.isfinite(deviation) & np.isfinite(systematic)
    if not known.any():
        return noise
    level = np.rint(np.clip(maps[known], 0.0, 1.0) * (DELIVERED_LEVELS - 1)).astype(int)
    equal = systematic[known].astype(float) ** 2
    rest = np.maximum(deviation[known].astype(float) ** 2 - equal, 0.0)
    return replace(
        noise,
        random=_root_means_by_level(level, rest),
        systematic=_root_means_by_level(level, equal),
    )


def _root_means_by_level(level: NDArray[np.int_], squares: FloatArray) -> tuple[float, ...]:
    """Return the roots of the mean `squares` of each level, from neighbours where it has none."""
    counts = np.bincount(level, minlength=DELIVERED_LEVELS)
    sums = np.bincount(level, squares, minlength=DELIVERED_LEVELS)
    there = np.flatnonzero(counts)
    means = np.interp(np.arange(DELIVERED_LEVELS), there, sums[there] / counts[there])
    return tuple(float(value) for value in np.sqrt(means))


def _full_cells(maps: FloatArray, smooth: FloatArray, lowest: FloatArray) -> NDArray[np.bool_]:
    """Return the mask (nt, nz, nx) of full cells; `lowest` is the local minimum of `smooth`.

    A fading plume is full at few places only, and their grain may differ from the typical one.
    Therefore the first level with many different cells is preferred, or, if no level has many, the
    first one with `MOST_CELLS` of those at the lowest level.
    """
    levels = (*FULL_LEVELS, FALLBACK_LEVEL * float(np.quantile(smooth, HIGHEST_QUANTILE)))
    *masks, palest = [(lowest > level) & np.isfinite(maps) for level in levels]
    cells = [np.count_nonzero(mask.any(axis=0)) for mask in masks]
    wanted = min(2 * FEWEST_VALUES, MOST_CELLS * cells[-1])
    full = next(mask for mask, count in zip(masks, cells, strict=True) if count >= wanted)
    return full if np.count_nonzero(full) > FEWEST_VALUES else palest


def _half_normal_deviation(values: FloatArray) -> float:
    """Return the standard deviation of a normal with mean zero, negative values clipped to zero."""
    return float(np.sqrt(2.0 * np.mean(np.square(values)))) if values.size else 0.0


def _deviation_in_plume(
    maps: FloatArray, smooth: FloatArray, full: NDArray[np.bool_], width: float
) -> float:
    """Return the standard deviation of full cells about their local mean, relative to that mean.

    Two corrections are applied: the local mean takes up a part of a noise of `width` [cells], and
    clipping at 1 takes away the upper tail. If nearly all values are clipped, or fewer than
    `FEWEST_VALUES` are full, the result is at most `PLUME_NOISE_GUESS`.
    """
    if not full.any():
        return PLUME_NOISE_GUESS
    values = maps[full]
    remainder = np.sqrt(float(_covariance_about_mean(0.0, np.array(width), SMOOTHING_WIDTH)))
    deviation = float(np.std(values / smooth[full] - 1.0)) / remainder
    clipped = float(np.mean(values >= CLIPPED))
    found = float(deviation / _censored_deviation(clipped))
    enough = clipped <= MOST_CLIPPED and values.size >= FEWEST_VALUES
    return found if enough else min(found, PLUME_NOISE_GUESS)


def _covariance_about_mean(distance: float, width: FloatArray, mean_width: float) -> FloatArray:
    """Return the covariance of unit noise about its local mean, at a `distance` [cells].

    The noise is white noise convolved with a Gaussian of `width` w; the local mean is a Gaussian of
    `mean_width` m. With C(b) = 2 w^2 / (2 w^2 + b) exp(-d^2 / (2 (2 w^2 + b))), the covariance is
    C(0) - 2 C(m^2) + C(2 m^2).
    """

    def smoothed(by: float) -> FloatArray:
        square = 2.0 * width**2 + by
        return 2.0 * width**2 / square * np.exp(-0.5 * distance**2 / square)

    return smoothed(0.0) - 2.0 * smoothed(mean_width**2) + smoothed(2.0 * mean_width**2)


def _censored_deviation(share: float) -> float:
    """Return the standard deviation of a standard normal with its upper `share` clipped."""
    if share < 1e-6:
        return 1.0
    share = min(share, MOST_CLIPPED)
    bound = float(ndtri(1.0 - share))
    mean = bound * share - float(normal_density(np.array(bound)))
    square = bound**2 * share + float(second_moment(np.array(bound)))
    return float(np.sqrt(square - mean**2))


def _frame_noise(maps: FloatArray, full: NDArray[np.bool_]) -> float:
    """Return the standard deviation of the frame noise, from differences of successive frames."""
    both = full[1:] & full[:-1] & (maps[1:] < CLIPPED) & (maps[:-1] < CLIPPED)
    if np.count_nonzero(both) < FEWEST_VALUES:
        return FRAME_NOISE_GUESS
    change = (maps[1:] - maps[:-1])[both]
    typical = max(float(np.median(np.abs(change))), LEAST_CHANGE)
    noise = np.abs(change) < OUTLIER_DEVIATIONS * typical
    return float(np.std(change[noise]) / np.sqrt(2.0))


def _grain_width(maps: FloatArray, full: NDArray[np.bool_]) -> float:
    """Return the width [cells] of the grain, from the correlation of neighbouring cells.

    A wide local mean is subtracted first: a plume that fades across the rig is not grain.
    """
    pairs = full[:, :, 1:] & full[:, :, :-1]
    if np.count_nonzero(pairs) < 2 * FEWEST_VALUES:
        return WIDTH_GUESS
    width = (0.0, GRAIN_MEAN_WIDTH, GRAIN_MEAN_WIDTH)
    weight = gaussian_filter(full.astype(float), width)
    mean = gaussian_filter(np.where(full, maps, 0.0), width) / np.maximum(weight, 1e-9)
    grain = maps - mean
    a, b = grain[:, :, 1:][pairs], grain[:, :, :-1][pairs]
    if min(np.ptp(a), np.ptp(b)) == 0.0:
        return WIDTH_GUESS
    neighbours, own = (
        _covariance_about_mean(distance, GRAIN_WIDTHS, GRAIN_MEAN_WIDTH) for distance in (1.0, 0.0)
    )
    return float(np.interp(np.corrcoef(a, b)[0, 1], neighbours / own, GRAIN_WIDTHS))


def measure_point_spread_width(observed: FloatArray, predicted: FloatArray, noise: Noise) -> float:
    """Return the point spread width [cells] that brings `predicted` closest to `observed`.

    Both are maps (nt, nz, nx) [-]; cells with NaN in `observed` do not count. The result is 0 where
    no point spread improves the agreement.
    """

    def error(width: float) -> float:
        difference = noise.expected(blurred(predicted, width)) - observed
        return float(np.nanmean(difference**2))

    found = minimize_scalar(
        error,
        bounds=(0.0, LARGEST_POINT_SPREAD),
        method='bounded',
        options={'xatol': POINT_SPREAD_TOLERANCE},
    )
    return float(found.x) if found.fun < error(0.0) else 0.0
