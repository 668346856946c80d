"""The error of concentrations from light that is not the light of the baseline.

Errors are estimated in log ratios and multiplied with d concentration / d log ratio. The drift of
light is measured on clean sand and continued below the plume. It is less certain there.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.sampling import SAMPLING
from porotwin_imaging.tracer.calibration import CLEAN, Calibration


@dataclass(frozen=True)
class LightErrorSettings:
    """Error of the map from light that differs from the baseline (`light_error.py`)."""

    measured: float = 3e-4
    """Standard deviation of the drift of light on clean sand, where it is measured [log ratio]."""
    below_plume: float = 2e-3
    """The same where clean sand is far: the drift is continued by a quadratic [log ratio]."""
    reach: float = 0.02
    """Distance over which clean sand tells the light, relative to the width of the map [-]."""


LIGHT_ERROR = LightErrorSettings()


Array = NDArray[Any]

_STEP = 0.01
"""Step of the log ratio of a numerical derivative [-]."""


@dataclass(frozen=True)
class SeenTracer:
    """A photograph relative to its baseline, and the tracer that was seen in it.

    Attributes:
        log_ratio: log of light relative to the baseline, shape (nz, nx, 3 = red, green, blue).
        light_variance: variance of the local light that was removed, shape (nz, nx).
        factors: factor of the sand of each cell, shape (nz, nx).
        values: concentration, same shape, NaN where it is hidden.
    """

    log_ratio: Array
    light_variance: Array
    factors: Array
    values: Array


def light_error(
    seen: SeenTracer,
    calibration: Calibration,
) -> Array:
    """Return the standard deviation of concentrations (nz, nx) that wrong light causes.

    Light changes slowly, so that fine maps are judged on coarser cells.
    """
    factor = round(seen.values.shape[1] / SAMPLING.judged_columns)
    if factor > 1:
        coarse = light_error(_coarser(seen, factor), calibration)
        return np.asarray(cv2.resize(coarse, seen.values.shape[::-1]))
    visible = np.isfinite(seen.values)
    values = np.where(visible, seen.values, 0.0).astype(np.float32)
    reach = LIGHT_ERROR.reach * values.shape[1]
    clean = _smooth((values < CLEAN).astype(np.float32), visible, reach)
    continued = LIGHT_ERROR.below_plume * (1.0 - clean)
    error = np.sqrt(LIGHT_ERROR.measured**2 + continued**2 + seen.light_variance)
    return error * _sensitivity(seen, values, calibration)


def _coarser(seen: SeenTracer, factor: int) -> SeenTracer:
    """Return means over blocks of `factor` cells each way; blocks with hidden cells are hidden."""
    nz, nx = (max(1, size // factor) for size in seen.values.shape)
    return SeenTracer(
        *(
            cv2.resize(np.asarray(plane, np.float32), (nx, nz), interpolation=cv2.INTER_AREA)
            for plane in (seen.log_ratio, seen.light_variance, seen.factors, seen.values)
        )
    )


def _sensitivity(seen: SeenTracer, values: Array, calibration: Calibration) -> Array:
    """Return d concentration / d log ratio (nz, nx) for a change of all channels."""
    response, signal = calibration.response, calibration.signal
    slope = response.slope_at(np.interp(values, response.concentration, response.signal))
    change = signal.of(seen.log_ratio - np.float32(_STEP)) - signal.of(seen.log_ratio)
    return np.abs(change / _STEP * seen.factors * slope)


def _smooth(values: Array, visible: NDArray[np.bool_], sigma: float) -> Array:
    """Return the local mean of the visible `values`, by a Gaussian of width `sigma` [cells]."""
    weight = cv2.GaussianBlur(visible.astype(np.float32), (0, 0), sigma)
    total = cv2.GaussianBlur(np.where(visible, values, 0.0).astype(np.float32), (0, 0), sigma)
    return np.asarray(total / np.maximum(weight, SMALLEST_DIVISOR))
