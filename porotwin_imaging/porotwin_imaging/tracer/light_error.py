"""The error of concentrations from light that is not the light of the baseline.

Errors are estimated in log ratios and multiplied with d concentration / d log ratio:

- The drift of light is measured on clean sand and continued below the plume. It is less certain
  there.
- A shadow or a veil changes all channels alike, tracer changes each by its own share. Colours that
  tracer cannot make show light that the drift did not take up. Behind tracer this colour is that of
  the tracer too, so that light on clean sand counts for the whole photograph.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.sampling import SAMPLING
from porotwin_imaging.tracer.calibration import CLEAN, Calibration
from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS
from porotwin_imaging.tracer.tracer_signal import TracerSignal


@dataclass(frozen=True)
class LightErrorSettings:
    """Error of the map from light that differs from the baseline (`light_error.py`)."""

    measured: float = 3e-4
    """Standard deviation of the drift of light on clean sand, where it is measured [log ratio]."""
    below_plume: float = 2e-3
    """The same where clean sand is far: the drift is continued by a quadratic [log ratio]."""
    reach: float = 0.02
    """Distance over which clean sand tells the light, relative to the width of the map [-]."""
    full: float = 0.7
    """Higher values show the colour of tracer stock [-]."""
    smoothing_cells: float = 3.0
    """Width of the local mean of colours [cells]; light changes slowly."""
    front_step: float = 0.02
    """Larger steps between cells are fronts [-]."""
    colour_tolerance: float = 0.02
    """Smaller changes of colour are noise or drift [log ratio]."""
    dye_tolerance: float = 0.06
    """The same for tracer stock: its colour differs from sand to sand [log ratio]."""


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
    foreign = _foreign_light(seen, values, visible, calibration)
    veil = _veil(seen, foreign, visible & (values < CLEAN))
    error = np.sqrt(
        LIGHT_ERROR.measured**2 + continued**2 + foreign**2 + veil**2 + seen.light_variance
    )
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


def _veil(seen: SeenTracer, foreign: Array, clean: NDArray[np.bool_]) -> Array:
    """Return the log ratio (nz, nx) of a veil as bright as the `foreign` light of clean sand.

    Light that a veil adds counts for more where tracer leaves less.
    """
    if not clean.any():
        return np.zeros_like(foreign)
    typical = float(np.median(foreign[clean]))
    return typical * np.exp(-np.minimum(seen.log_ratio.mean(axis=-1), 0.0))


def _sensitivity(seen: SeenTracer, values: Array, calibration: Calibration) -> Array:
    """Return d concentration / d log ratio (nz, nx) for a change of all channels."""
    response, signal = calibration.response, calibration.signal
    slope = response.slope_at(np.interp(values, response.concentration, response.signal))
    change = signal.of(seen.log_ratio - np.float32(_STEP)) - signal.of(seen.log_ratio)
    return np.abs(change / _STEP * seen.factors * slope)


def _foreign_light(
    seen: SeenTracer,
    values: Array,
    visible: NDArray[np.bool_],
    calibration: Calibration,
) -> Array:
    """Return the log ratio (nz, nx) of light that the colours show, 0 where it is in doubt.

    The colour of stock is that of the fullest cells. Without enough of them nothing is known. A
    grey tracer, or a grey photograph, has no colour that tells light.
    """
    full = visible & (values > LIGHT_ERROR.full)
    if np.count_nonzero(full) < FEWEST_CELLS:
        return np.zeros_like(values)
    stock = np.median(seen.log_ratio[full], axis=0)
    if np.ptp(stock) < LIGHT_ERROR.colour_tolerance + LIGHT_ERROR.dye_tolerance:
        return np.zeros_like(values)
    share = values / float(np.median(values[full]))
    expected, turned = _colour_of_tracer(share, stock, calibration.signal)
    apart, even = seen.log_ratio - expected, visible & _is_even(values)
    smooth = np.stack(
        [_smooth(apart[..., channel], even, LIGHT_ERROR.smoothing_cells) for channel in range(3)],
        axis=-1,
    )
    found = (smooth * turned).sum(axis=-1) / np.maximum((turned**2).sum(axis=-1), SMALLEST_DIVISOR)
    doubt = LIGHT_ERROR.colour_tolerance + LIGHT_ERROR.dye_tolerance * share
    return np.sqrt(np.maximum(found**2 - doubt**2, 0.0))


def _is_even(values: Array) -> NDArray[np.bool_]:
    """Return where a map (nz, nx) has no front: a cell with a front has no colour of its own."""
    steps = np.hypot(*np.gradient(values))
    front = (steps > LIGHT_ERROR.front_step).astype(np.uint8)
    return np.asarray(cv2.dilate(front, np.ones((3, 3), np.uint8)) == 0)


def _colour_of_tracer(share: Array, stock: Array, signal: TracerSignal) -> tuple[Array, Array]:
    """Return log ratios of tracer with a `share` of stock, and what a change of light adds to them.

    Both have the shape (nz, nx, 3). A change of light by 1 in all channels is partly taken for
    tracer, by as much as the weights of the signal say; the second result is the rest.
    """
    if signal.contrast == 'difference':
        taken = 1.0 - np.exp(stock)
        left = np.maximum(1.0 - share[..., None] * taken, np.exp(stock) / 2)
        expected, slope = np.log(left), -taken / left
        weights = np.asarray(signal.weights) * left
    else:
        expected = share[..., None] * stock
        slope = np.broadcast_to(stock, expected.shape)
        weights = np.broadcast_to(np.asarray(signal.weights), expected.shape)
    taken_for_tracer = weights.sum(axis=-1) / (weights * slope).sum(axis=-1)
    return expected, 1.0 - taken_for_tracer[..., None] * slope


def _smooth(values: Array, visible: NDArray[np.bool_], sigma: float) -> Array:
    """Return the local mean of the visible `values`, by a Gaussian of width `sigma` [cells]."""
    weight = cv2.GaussianBlur(visible.astype(np.float32), (0, 0), sigma)
    total = cv2.GaussianBlur(np.where(visible, values, 0.0).astype(np.float32), (0, 0), sigma)
    return np.asarray(total / np.maximum(weight, SMALLEST_DIVISOR))
