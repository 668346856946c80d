"""The standard deviation of a map: a random and a systematic part.

Random errors change from photograph to photograph: noise of the camera, after denoising.
Systematic errors stay the same: the scale and the response of the calibration, and the place.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.settings import DEFAULTS, NoiseSettings

Array = NDArray[Any]

_SMALLEST_DIVISOR = 1e-9


@dataclass(frozen=True)
class MapDeviation:
    """Standard deviations of a map, shape (nz, nx), NaN where the map is NaN.

    Attributes:
        total: of random and systematic errors together.
        systematic: of the errors that stay the same from photograph to photograph.
    """

    total: Array
    systematic: Array


def map_deviation(
    noise: Array, values: Array, scale_error: float, settings: NoiseSettings = DEFAULTS.noise
) -> MapDeviation:
    """Return the deviation of denoised `values` (nz, nx).

    Denoising averages over n = 1 + 2 noise / |gradient| cells, those with the same concentration to
    within the noise. The errors of light and scale do not average out:

        sqrt((noise / n)^2 + (scale_error values)^2 + light_error^2).
    """
    slope = np.hypot(*np.gradient(np.nan_to_num(values)))
    reach = np.clip(
        noise / np.maximum(slope, _SMALLEST_DIVISOR), 0.0, settings.averaging_reach_cells
    )
    averaged = noise / (1.0 + 2.0 * reach)
    systematic = np.hypot(scale_error * values, settings.light_error)
    return MapDeviation(np.hypot(averaged, systematic), systematic)
