"""What the maps themselves leave unsure: sand grain, frame noise and edge blur, measured.

The recorded map is modelled as

    clip(c (1 + grain) + frame noise, 0, 1),    c blurred over `blur` cells

with a grain that is fixed in place and a frame noise that is new in every frame. Both are read off
the recording itself: the grain and its noise where the plume is full, the rest where there is no
tracer. Clipping makes the noise one-sided there; half of a normal distribution is still enough.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter
from scipy.optimize import minimize_scalar
from scipy.special import ndtr, ndtri

from porotwin_core.grid import FloatArray

FULL, HALF = (0.9, 0.8, 0.7), 0.6
"""Levels of the smoothed map above which the plume is full, the first that leaves enough; where
none does, this share of the fullest."""

EMPTY = 0.02
"""Level of the smoothed map below which there is no tracer."""

FEWEST, PLACES = 200, 400
"""Values that a statement needs, and cells, for the grain of a cell is the same in every frame."""

LOCAL_MEAN, GRAIN_MEAN = 1.5, 3.0
"""Widths [cells] over which a map is smoothed to tell noise from tracer, and to see how wide its
grain is."""

MARGIN = 5
"""Cells kept between a front and the cells that are taken to be full or empty."""

GRAIN_WIDTHS = np.linspace(0.3, 3.0, 271)
"""Widths [cells] that a grain may have."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations relative to the tracer stock, before clipping.

    `grain` is that of the fixed pattern, relative to c; `frame` that of one frame in the plume,
    `background` in tracer-free sand; `correlation` is the width [cells] over which the grain is
    one; `blur` the width [cells] of the edge blur.
    """

    grain: float
    frame: float
    background: float
    correlation: float = 1.0
    blur: float = 0.0

    def deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the standard deviation of the noise at each value of `concentration`."""
        c = np.clip(concentration, 0.0, 1.0)
        return np.hypot(self.grain * c, self.frame_deviation(c))

    def frame_deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the same of the part that is new in every frame."""
        c = np.clip(concentration, 0.0, 1.0)
        return self.background + (self.frame - self.background) * c

    def expected(self, concentration: FloatArray) -> FloatArray:
        """Return the mean that clipping to 0..1 leaves of a noisy map of `concentration`, 0..1."""
        levels, means = self._clipped_means
        return np.interp(concentration, levels, means)

    @cached_property
    def _clipped_means(self) -> tuple[FloatArray, FloatArray]:
        """Concentrations and their means after clipping, close enough to interpolate between."""
        c = np.linspace(0.0, 1.0, 2001)
        sd = np.maximum(self.deviation(c), 1e-6)
        return c, c + sd * (_below(c / sd) - _below((1 - c) / sd))

    def clipped_deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the root mean square of recorded minus true value, clipping included."""
        sd = np.maximum(self.deviation(concentration), 1e-6)
        below, above = -concentration / sd, (1 - concentration) / sd
        inner = _second_moment(above) - _second_moment(below)
        tails = below**2 * ndtr(below) + above**2 * ndtr(-above)
        return sd * np.sqrt(inner + tails)


def _density(z: FloatArray) -> FloatArray:
    return np.exp(-0.5 * np.minimum(z**2, 80.0)) / np.sqrt(2 * np.pi)


def _below(z: FloatArray) -> FloatArray:
    """Return E[max(0, -Z - z)] of a standard normal Z: what a bound `z` away adds to the mean."""
    return _density(z) - z * ndtr(-z)


def _second_moment(z: FloatArray) -> FloatArray:
    """Return the integral of t^2 times the normal density up to `z`."""
    z = np.clip(z, -40.0, 40.0)
    return ndtr(z) - z * _density(z)


def measure_noise(maps: FloatArray) -> Noise:
    """Return the noise of `maps` (nt, nz, nx), NaN where the image says nothing.

    Where nothing is full enough, the grain is taken from the middle of the fullest cells; where
    nothing is empty, the background counts as quiet. The edge blur is left at zero: it shows only
    beside a model (`measure_blur`).
    """
    known = np.where(np.isfinite(maps), maps, 0.0)
    smooth = np.stack([gaussian_filter(frame, LOCAL_MEAN) for frame in known])
    window = (1, 2 * MARGIN + 1, 2 * MARGIN + 1)
    empty = (maximum_filter(smooth, window) < EMPTY) & np.isfinite(maps)
    full = _full(maps, smooth, minimum_filter(smooth, window))
    background = _one_sided(known[empty]) if np.count_nonzero(empty) > FEWEST else 0.0
    width = _grain_width(known, full)
    total = _deviation_in_plume(known, smooth, full, width)
    frame = _frame_noise(known, full)
    grain = float(np.sqrt(max(total**2 - frame**2, 0.0)))
    return Noise(grain, frame, background, width)


def _full(maps: FloatArray, smooth: FloatArray, inner: FloatArray) -> NDArray[np.bool_]:
    """Return where the plume is full; `inner` is the least of the `smooth` maps around.

    A plume that fades is full at few places, whose grain need not be that of the others.
    """
    levels = (*FULL, HALF * float(np.quantile(smooth, 0.995)))
    tried = [(inner > level) & np.isfinite(maps) for level in levels]
    wide = (full for full in tried[:-1] if np.count_nonzero(full.any(axis=0)) > PLACES)
    enough = (full for full in tried if np.count_nonzero(full) > FEWEST)
    return next(wide, next(enough, tried[-1]))


def _one_sided(values: FloatArray) -> float:
    """Return the deviation of a zero-mean normal whose negative half was clipped to zero."""
    return float(np.sqrt(2.0 * np.mean(np.square(values)))) if values.size else 0.0


def _deviation_in_plume(
    maps: FloatArray, smooth: FloatArray, full: NDArray[np.bool_], width: float
) -> float:
    """Return the deviation of maps about their local mean, relative to it, before clipping at 1 and
    with what that mean takes from a noise of `width`."""
    if not full.any():
        return 0.02
    values = maps[full]
    left = np.sqrt(float(_about_local_mean(0.0, np.array(width), LOCAL_MEAN)))
    deviation = float(np.std(values / smooth[full] - 1.0)) / left
    return float(deviation / _censored_deviation(float(np.mean(values >= 0.999))))


def _about_local_mean(distance: float, width: FloatArray, local: float) -> FloatArray:
    """Return the covariance, `distance` cells apart, that a noise of unit deviation and of `width`
    keeps about its mean over a Gaussian of `local` cells; `width` is that of the Gaussian which
    makes it of white noise."""

    def smoothed(by: float) -> FloatArray:
        square = 2.0 * width**2 + by
        return 2.0 * width**2 / square * np.exp(-0.5 * distance**2 / square)

    return smoothed(0.0) - 2.0 * smoothed(local**2) + smoothed(2.0 * local**2)


def _censored_deviation(share: float) -> float:
    """Return the deviation of a standard normal whose upper `share` is cut down to its bound."""
    if share < 1e-6:
        return 1.0
    share = min(share, 0.9)
    bound = float(ndtri(1.0 - share))
    mean = bound * share - float(_density(np.array(bound)))
    square = bound**2 * share + float(_second_moment(np.array(bound)))
    return float(np.sqrt(square - mean**2))


def _frame_noise(maps: FloatArray, full: NDArray[np.bool_]) -> float:
    """Return the noise that is new in every frame, from differences of frames off the bounds."""
    both = full[1:] & full[:-1] & (maps[1:] < 0.99) & (maps[:-1] < 0.99)
    if np.count_nonzero(both) < FEWEST:
        return 0.01
    change = (maps[1:] - maps[:-1])[both]
    near = np.abs(change) < 6.0 * max(float(np.median(np.abs(change))), 0.004)
    return float(np.std(change[near]) / np.sqrt(2.0))


def _grain_width(maps: FloatArray, full: NDArray[np.bool_]) -> float:
    """Return the width [cells] of the Gaussian that makes a noise of white noise in which
    neighbouring cells correlate as in the grain.

    Relative to a wide local mean, for a plume that fades from one side to the other is no grain.
    """
    pairs = full[:, :, 1:] & full[:, :, :-1]
    if np.count_nonzero(pairs) < 2 * FEWEST:
        return 1.0
    width = (0.0, GRAIN_MEAN, GRAIN_MEAN)
    weight = gaussian_filter(full.astype(float), width)
    around = gaussian_filter(np.where(full, maps, 0.0), width) / np.maximum(weight, 1e-9)
    grain = maps - around
    a, b = grain[:, :, 1:][pairs], grain[:, :, :-1][pairs]
    if min(np.ptp(a), np.ptp(b)) == 0.0:
        return 1.0
    neighbours, own = (_about_local_mean(d, GRAIN_WIDTHS, GRAIN_MEAN) for d in (1.0, 0.0))
    return float(np.interp(np.corrcoef(a, b)[0, 1], neighbours / own, GRAIN_WIDTHS))


def measure_blur(observed: FloatArray, predicted: FloatArray, noise: Noise) -> float:
    """Return the blur [cells] that brings `predicted` nearest to `observed`, both (nt, nz, nx)."""

    def error(width: float) -> float:
        difference = noise.expected(blur(predicted, width)) - observed
        return float(np.nanmean(difference**2))

    found = minimize_scalar(error, bounds=(0.0, 1.2), method='bounded', options={'xatol': 0.03})
    return float(found.x) if found.fun < error(0.0) else 0.0


def blur(maps: FloatArray, width: float) -> FloatArray:
    """Return `maps` (nt, nz, nx) blurred over `width` cells in the plane."""
    return gaussian_filter(maps, (0.0, width, width)) if width > 0 else maps


def noise_floor(noise: Noise, model: FloatArray, observed: FloatArray) -> float:
    """Return the relative L2 error that the noise alone leaves over the cells that are observed.

    `model` (nt, nz, nx) stands for the true maps: fluctuation, clipping and edge blur about it.
    """
    known = np.isfinite(observed)
    soft = blur(model, noise.blur)
    square = noise.clipped_deviation(soft) ** 2 + (soft - model) ** 2
    square += 2.0 * (noise.expected(soft) - soft) * (soft - model)
    norm = float(np.linalg.norm(observed[known]))
    return float(np.sqrt(square[known].sum()) / max(norm, 1e-12))
