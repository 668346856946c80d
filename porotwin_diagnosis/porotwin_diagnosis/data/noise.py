"""The noise model of a recorded map.

A recorded map o follows from the true concentration c by

    o = clip(P(c) (1 + g) + n, 0, 1).

P is the point spread of the camera, a Gaussian. g is the grain of the sand: a fixed pattern that is
the same in every frame. n is the frame noise, which is independent from frame to frame. Clipping
shifts the mean and reduces the variance. Both follow from the moments of a censored normal
distribution (Greene, Econometric Analysis, section on censored data).

Maps from photographs may come with standard deviations. They include errors that denoising hides,
and a wrong scale. The delivered deviations, random and systematic, are kept as functions of the
concentration. They bound the noise from below.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import FloatArray

SMOOTHING_WIDTH = 1.5
"""Width [cells] of the smoothing of maps and residuals: wider than grain and point spread, narrower
than the front displacements of interest."""

TRACER_PRESENT = 0.03
"""Smoothed concentration [-] above which a cell holds tracer, well above the background noise."""

CLIPPING_TABLE_SIZE = 2001
"""Number of concentrations in the table of means after clipping. Their distance of 0.0005 is far
below the noise of any camera, so that linear interpolation is exact enough."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the noise, relative to the tracer stock and before clipping.

    Attributes:
        grain: standard deviation of the grain g [-], relative to the concentration.
        frame: standard deviation of the frame noise n [-] where c = 1.
        background: standard deviation of the frame noise n [-] where c = 0.
        correlation: width [cells] of the Gaussian kernel that turns white noise into the grain.
        point_spread_width: width [cells] of the Gaussian point spread P.
        random: delivered random deviations [-] at evenly spaced concentrations from 0 to 1; empty
            if the recording has none.
        systematic: the same for deviations that are equal in all maps.
    """

    grain: float
    frame: float
    background: float
    correlation: float
    point_spread_width: float = 0.0
    random: tuple[float, ...] = ()
    systematic: tuple[float, ...] = ()

    def with_delivered(self, measured: FloatArray, concentration: FloatArray) -> FloatArray:
        """Return the deviation [-] of maps whose noise was `measured`, with the delivered ones.

        The measured noise and the delivered random deviation estimate the same error; the larger
        estimate counts. The systematic deviation is added in squares. All arrays have the shape
        of `concentration` [-].
        """
        if not self.random:
            return measured
        random, systematic = (
            np.interp(concentration, np.linspace(0.0, 1.0, len(values)), values)
            for values in (self.random, self.systematic)
        )
        return np.hypot(np.maximum(measured, random), systematic)

    def deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the standard deviation [-] of the noise before clipping, s(c).

        s(c)^2 = (grain c)^2 + frame_deviation(c)^2; the result has the shape of `concentration`.
        """
        c = np.clip(concentration, 0.0, 1.0)
        return np.hypot(self.grain * c, self.frame_deviation(c))

    def frame_deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the standard deviation [-] of the frame noise.

        It is background + (frame - background) c; the result has the shape of `concentration`.
        """
        c = np.clip(concentration, 0.0, 1.0)
        return self.background + (self.frame - self.background) * c

    def expected(self, concentration: FloatArray) -> FloatArray:
        """Return the mean of a noisy map of `concentration` [-] after clipping to 0..1.

        With the standard deviation s and the unit normal loss L(z) = E[max(0, Z - z)],

            E[o] = c + s (L(c / s) - L((1 - c) / s)).
        """
        means, steps = self._clipped_means
        place = np.clip(concentration, 0.0, 1.0) * (CLIPPING_TABLE_SIZE - 1)
        index = place.astype(np.intp)
        return np.asarray(means[index] + (place - index) * steps[index])

    @cached_property
    def _clipped_means(self) -> tuple[FloatArray, FloatArray]:
        """Means after clipping of evenly spaced concentrations, and their differences.

        Even spacing makes the interpolation several times as fast as `numpy.interp`.
        """
        c = np.linspace(0.0, 1.0, CLIPPING_TABLE_SIZE)
        sd = np.maximum(self.deviation(c), SMALLEST_DIVISOR)
        means = c + sd * (_normal_loss(c / sd) - _normal_loss((1 - c) / sd))
        return means, np.diff(means, append=means[-1])

    def clipped_deviation(self, concentration: FloatArray) -> FloatArray:
        """Return the root mean square [-] of recorded minus true concentration, with clipping.

        The result has the shape of `concentration`.
        """
        sd = np.maximum(self.deviation(concentration), SMALLEST_DIVISOR)
        below, above = -concentration / sd, (1 - concentration) / sd
        inner = second_moment(above) - second_moment(below)
        tails = below**2 * ndtr(below) + above**2 * ndtr(-above)
        return sd * np.sqrt(inner + tails)


def normal_density(z: FloatArray) -> FloatArray:
    """Return the standard normal density at `z` [-], any shape."""
    return np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)


def second_moment(z: FloatArray) -> FloatArray:
    """Return the integral of t^2 times the standard normal density from -infinity to `z`.

    It is Phi(z) - z phi(z), with the distribution function Phi and the density phi.
    """
    return ndtr(z) - z * normal_density(z)


def _normal_loss(z: FloatArray) -> FloatArray:
    """Return L(z) = E[max(0, Z - z)] = phi(z) - z (1 - Phi(z)) of a standard normal Z."""
    return normal_density(z) - z * ndtr(-z)


def blurred(maps: FloatArray, width: float) -> FloatArray:
    """Return `maps` (nt, nz, nx) convolved in the plane with a Gaussian of `width` [cells]."""
    return gaussian_filter(maps, (0.0, width, width)) if width > 0 else maps


def noise_floor(noise: Noise, model: FloatArray, observed: FloatArray) -> float:
    """Return the relative L2 error that a perfect model would leave because of the noise.

    Args:
        noise: noise and point spread of the recording.
        model: maps (nt, nz, nx) that take the place of the true ones.
        observed: maps (nt, nz, nx); cells with NaN do not count.

    The expected squared error of a cell is E[(o - c)^2] = s^2 + d^2 + 2 d E[o - P(c)] with
    d = P(c) - c, where s is `Noise.clipped_deviation` at P(c), or more where deviations were
    delivered.
    """
    seen = np.isfinite(observed)
    spread = blurred(model, noise.point_spread_width)
    square = noise.with_delivered(noise.clipped_deviation(spread), spread) ** 2
    square += (spread - model) ** 2
    square += 2.0 * (noise.expected(spread) - spread) * (spread - model)
    norm = float(np.linalg.norm(observed[seen]))
    return float(np.sqrt(square[seen].sum()) / max(norm, 1e-12))
