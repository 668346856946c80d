"""The signal of the tracer: one number for each cell from the photograph and its baseline.

With r the light that a cell sends in a photograph relative to the baseline, channel by channel,

    difference  s =   sum_i w_i (1 - r_i)   the pictures' difference, relative to the baseline
    absorbance  s = - sum_i w_i ln r_i      proportional to concentration after Beer and Lambert

with weights w of red, green and blue: all alike (grey), red alone, or a direction learned from
calibration photographs. Both are ratios to the baseline: the grains' own brightness drops out.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

Contrast = Literal['absorbance', 'difference']

LEAST_RATIO = 0.02
"""Darkest photograph relative to its baseline; below, the camera sees nothing but noise."""

CHANNELS = {'grey': (1 / 3, 1 / 3, 1 / 3), 'red': (1.0, 0.0, 0.0)}


@dataclass(frozen=True)
class Signal:
    """How tracer is read off; `weights` of red, green and blue."""

    contrast: Contrast = 'difference'
    weights: tuple[float, float, float] = CHANNELS['red']

    def of(self, log_ratio: Array) -> Array:
        """Return the signal (nz, nx) from log ratios (nz, nx, 3 = red, green, blue)."""
        bounded = np.maximum(log_ratio, np.float32(np.log(LEAST_RATIO)))
        seen = -bounded if self.contrast == 'absorbance' else 1.0 - np.exp(bounded)
        return seen @ np.asarray(self.weights, np.float32)

    def noise(self, log_ratio: Array, variance: Array) -> Array:
        """Return the signal's standard deviation from the log ratios' `variance` (nz, nx, 3).

        The channels' errors are independent: each has a sensor of its own.
        """
        slope = np.ones_like(log_ratio)
        if self.contrast == 'difference':
            slope = np.exp(np.maximum(log_ratio, np.float32(np.log(LEAST_RATIO))))
        weights = np.asarray(self.weights, np.float32)
        return np.sqrt((slope**2 * variance) @ weights**2)


def learned_weights(log_ratio: Array, background: Array) -> tuple[float, float, float]:
    """Return the weights that tell tracer best from noise and light, for absorbance.

    `log_ratio` (n, 3) of places with tracer, `background` (n, 3) of places without, where light,
    noise and colour fluctuate. Fisher's discriminant: w = S^-1 d, scaled to sum |w| = 1, with d
    the mean absorbance of tracer and S the covariance of the background and of a common drift.
    """
    direction = -log_ratio.mean(axis=0)
    covariance = np.cov(background.T) + 1e-6 * np.eye(3)
    weights = np.linalg.solve(covariance, direction)
    weights /= np.abs(weights).sum()
    if weights @ direction < 0:
        weights = -weights
    red, green, blue = (float(value) for value in weights)
    return red, green, blue
