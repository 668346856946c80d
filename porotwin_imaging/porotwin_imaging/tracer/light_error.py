"""The error of concentrations from light that was corrected, and is not that of the baseline.

Errors are estimated in log ratios and multiplied with d concentration / d log ratio.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.tracer.calibration import Calibration

Array = NDArray[Any]

_STEP = 0.01
"""Step of the log ratio of a numerical derivative [-]."""


@dataclass(frozen=True)
class SeenTracer:
    """A photograph relative to its baseline, and the tracer that was seen in it.

    Attributes:
        log_ratio: log of light relative to the baseline, shape (nz, nx, 3 = red, green, blue).
        light_variance: variance of the light that was removed, shape (nz, nx) or (1, 1).
        factors: factor of the sand of each cell, shape (nz, nx).
        values: concentration, same shape, NaN where it is hidden.
    """

    log_ratio: Array
    light_variance: Array
    factors: Array
    values: Array


def light_error(seen: SeenTracer, calibration: Calibration) -> Array:
    """Return the standard deviation of concentrations (nz, nx) that corrected light causes."""
    if not seen.light_variance.any():
        return np.zeros_like(seen.values)
    response, signal = calibration.response, calibration.signal
    values = np.nan_to_num(seen.values)
    slope = response.slope_at(np.interp(values, response.concentration, response.signal))
    change = signal.of(seen.log_ratio - np.float32(_STEP)) - signal.of(seen.log_ratio)
    return np.sqrt(seen.light_variance) * np.abs(change / _STEP * seen.factors * slope)
