"""The signal of the tracer: one number per cell from the log ratio to the baseline.

With r_i the ratio of light to the baseline in channel i, and weights w_i of red, green and blue,

    difference  s =   sum_i w_i (1 - r_i)   relative difference of the pictures
    absorbance  s = - sum_i w_i ln r_i      proportional to concentration (Beer and Lambert)

The weights are equal (grey), red alone, or a direction learned from calibration photographs. Both
signals use ratios, so that the own brightness of the grains cancels.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.tracer.tracer_colour import TracerColour

Array = NDArray[Any]

Contrast = Literal['absorbance', 'difference']

LEAST_RATIO = 0.02
"""Smallest ratio to the baseline; a darker photograph contains only noise of the camera."""
CHANNELS = {'grey': (1 / 3, 1 / 3, 1 / 3), 'red': (1.0, 0.0, 0.0)}
"""Weights of red, green and blue that need no photographs."""


@dataclass(frozen=True)
class TracerSignal:
    """The definition of the signal.

    Attributes:
        contrast: 'difference' or 'absorbance', see the module.
        weights: weights of red, green and blue [-].
        absorbance: mean absorbance of tracer in red, green and blue, in any unit; None if it is not
            known. It tells tracer from light.
    """

    contrast: Contrast = 'difference'
    weights: tuple[float, float, float] = CHANNELS['red']
    absorbance: tuple[float, float, float] | None = None

    @property
    def tracer_colour(self) -> TracerColour | None:
        """Colour of the tracer; None if it is unknown or grey."""
        return None if self.absorbance is None else TracerColour.of_absorbance(self.absorbance)

    def of(self, log_ratio: Array) -> Array:
        """Return the signal (nz, nx) of log ratios (nz, nx, 3 = red, green, blue)."""
        bounded = np.maximum(log_ratio, np.float32(np.log(LEAST_RATIO)))
        darkening = -bounded if self.contrast == 'absorbance' else 1.0 - np.exp(bounded)
        return darkening @ np.asarray(self.weights, np.float32)

    def noise(self, log_ratio: Array, variance: Array) -> Array:
        """Return the standard deviation of the signal, shape (nz, nx).

        `variance` (nz, nx, 3) is the variance of the log ratios. The errors of the channels are
        independent, because each has its own sensor.
        """
        slope = np.ones_like(log_ratio)
        if self.contrast == 'difference':
            slope = np.exp(np.maximum(log_ratio, np.float32(np.log(LEAST_RATIO))))
        weights = np.asarray(self.weights, np.float32)
        return np.sqrt((slope**2 * variance) @ weights**2)


def learned_weights(log_ratio: Array, background: Array) -> tuple[float, float, float]:
    """Return the weights that separate tracer best from noise and light, for absorbance.

    Fisher's discriminant: w = S^-1 d, scaled to sum |w| = 1, with d the mean absorbance of tracer
    and S the covariance of the background.

    Args:
        log_ratio: log ratios of cells with tracer, shape (n, 3).
        background: log ratios of cells without tracer, where light, noise and colour fluctuate,
            shape (n, 3).
    """
    direction = -log_ratio.mean(axis=0)
    covariance = np.cov(background.T) + SMALLEST_DIVISOR * np.eye(3)
    weights = np.linalg.solve(covariance, direction)
    weights /= np.abs(weights).sum()
    if weights @ direction < 0:
        weights = -weights
    red, green, blue = (float(value) for value in weights)
    return red, green, blue


def mean_absorbance(log_ratio: Array) -> tuple[float, float, float]:
    """Return the absorbance of red, green and blue of cells with tracer, log ratios (n, 3)."""
    red, green, blue = (float(value) for value in -np.median(log_ratio, axis=0))
    return red, green, blue
