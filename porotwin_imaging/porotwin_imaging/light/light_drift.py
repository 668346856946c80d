"""The drift of light between baseline and photograph.

Lamps warm up and daylight moves. A photograph is brighter or darker than its baseline by a factor
that varies slowly over the rig. In log ratios to the baseline the drift is a sum,

    drift = c_channel + q(x, z),

with one constant per channel and a quadratic q that all channels share. The colour chart shows the
constants, and sand without tracer shows both. Robust weights (Tukey's biweight) separate tracer
from light, because tracer darkens the sand by more than light drifts.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.numerics.channels import channel_mean
from porotwin_imaging.numerics.robust_statistics import (
    FEW_ROUNDS,
    NOISE_SPREADS,
    SPREAD_PER_DEVIATION,
)
from porotwin_imaging.numerics.row_bands import row_bands


@dataclass(frozen=True)
class LightSettings:
    """Estimating the drift of light since the baseline (`light_drift.py`)."""

    least_background: float = 0.1
    """Share of the visible cells that must be free of tracer to fit the drift [-]."""
    tolerance: float = 0.06
    """Cut-off of Tukey's biweight [log ratio]: cells further from the drift are no background."""
    search_range: float = 0.25
    """Largest difference between chart and sand that can be light [log ratio]. A slope of the light
    over the rig is told from here on; it is below 0.08 on rendered and composed photographs."""
    most_cells: int = 12_000
    """Cells used of a finer map: the drift varies slowly, a regular subset is enough."""
    histogram_bin: float = 0.01
    """Bin width of the histogram for the start value [log ratio]."""
    most_brighter: float = 0.08
    """Cells that are brighter than the baseline by more show a reflection [log ratio]. On real and
    rendered photographs the averages over 3 x 3 cells stay below 0.022, and below 0.053 in
    a single channel. From here on a cast, the difference between channels, is told too."""


LIGHT = LightSettings()


Array = NDArray[Any]

_TRACER_REACH = 25
"""Surroundings of tracer that are not used: this fraction of the width of the rig."""
_SHAPE_PENALTY = 1e-3
"""Relative penalty on the quadratic where the background does not determine it."""


@dataclass(frozen=True)
class LightDrift:
    """The light of a photograph relative to its baseline.

    Attributes:
        channels: log of the ratio in red, green and blue, shape (3,).
        shape: what all channels have beside it, shape (nz, nx).
        background: share of the visible cells that determined it [-]; 0 if only the chart did.
    """

    channels: Array
    shape: Array
    background: float

    @property
    def log_gain(self) -> Array:
        """Log of the ratio, shape (nz, nx, 3)."""
        return self.channels + self.shape[..., None]

    def removed_from(self, log_ratio: Array) -> Array:
        """Subtract the drift from the log ratio (nz, nx, 3) to the baseline in place; return it."""
        for band in row_bands(self.shape.shape):
            log_ratio[band] -= self.channels + self.shape[band][..., None]
        return log_ratio


def light_drift(
    log_ratio: Array,
    weight: Array,
    checker_gain: Array | None,
    *,
    search_range: float = LIGHT.search_range,
    scatter: float = 0.0,
) -> LightDrift:
    """Return the drift of light.

    Args:
        log_ratio: log ratio of photograph to baseline, shape (nz, nx, 3).
        weight: weight of each cell, 0 where it is not visible, shape (nz, nx).
        checker_gain: log gain at the colour chart, shape (3,), or None.
        search_range: distance from that gain within which the light is searched [log].
        scatter: by how much places of the same light differ between the two photographs [log].
    """
    shape = log_ratio.shape[:2]
    stride = max(1, round(np.sqrt(weight.size / LIGHT.most_cells)))
    subset = (slice(stride // 2, None, stride), slice(stride // 2, None, stride))
    places = (place[cells] for place, cells in zip(_places(shape), subset, strict=True))
    seen, sand = log_ratio[subset], weight[subset]
    start = _start(seen, sand, checker_gain, search_range + scatter)
    found = _robust_fit(seen, sand, _terms(*places), start, LIGHT.tolerance + scatter)
    if found is None:
        gain = np.zeros(3) if checker_gain is None else checker_gain
        return LightDrift(gain.astype(np.float32), np.zeros(shape, np.float32), 0.0)
    constants, coefficients, background = found
    quadratic = _quadratic(coefficients.astype(np.float32), *_places(shape))
    return LightDrift(constants.astype(np.float32), quadratic, background)


def _robust_fit(
    log_ratio: Array,
    weight: Array,
    terms: Array,
    start: Array,
    tolerance: float,
) -> tuple[Array, Array, float] | None:
    """Return constants (3,), coefficients (5,) and background share; None without background."""
    constants = start
    coefficients: Array = np.zeros(terms.shape[-1])
    visible = weight > 0
    share = 0.0
    # the second half without the surroundings of tracer
    for step in range(2 * FEW_ROUNDS):
        residual = log_ratio - constants - (terms @ coefficients)[..., None]
        distance = np.sqrt(channel_mean(residual**2)) / tolerance
        background = weight * np.clip(1.0 - distance**2, 0.0, None) ** 2
        if step >= FEW_ROUNDS:
            background = background * _away_from_tracer(channel_mean(residual))
        share = float((background > 0).sum() / max(1, visible.sum()))
        if share < LIGHT.least_background:
            return None
        constants, coefficients = _fit(log_ratio, terms, background)
    return constants, coefficients, share


def _away_from_tracer(residual: Array) -> Array:
    """Return 0 near tracer, otherwise 1: the faint rim of a plume looks like dimmer light."""
    smooth = cv2.blur(residual, (3, 3))
    spread = SPREAD_PER_DEVIATION * np.median(np.abs(smooth - np.median(smooth)))
    dark = (smooth < -NOISE_SPREADS * spread - LIGHT.histogram_bin).astype(np.uint8)
    dark = cv2.morphologyEx(dark, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    reach = 2 * max(2, residual.shape[1] // _TRACER_REACH) + 1
    return 1.0 - cv2.dilate(dark, np.ones((reach, reach), np.uint8))


def _start(log_ratio: Array, weight: Array, checker_gain: Array | None, reach: float) -> Array:
    """Return the start value (3,): the most frequent log ratio of the sand near the chart gain."""
    expected: Array = np.zeros(3) if checker_gain is None else checker_gain
    values = log_ratio[weight > 0]
    if not len(values):
        return expected
    grey = values.mean(axis=1)
    width = LIGHT.histogram_bin
    edges = np.arange(expected.mean() - reach, expected.mean() + reach + width, width)
    counts = np.histogram(grey, edges)[0]
    counts = np.convolve(counts, np.ones(3), mode='same')
    middle = 0.5 * (edges[:-1] + edges[1:])[int(np.argmax(counts))]
    near = np.abs(grey - middle) < 2 * width
    return np.median(values[near], axis=0) if near.any() else expected


def _places(shape: tuple[int, int]) -> tuple[Array, Array]:
    """Return the coordinates of rows and columns, from -1 to 1."""
    rows, columns = (np.linspace(-1, 1, count, dtype=np.float32) for count in shape)
    return rows, columns


def _terms(z: Array, x: Array) -> Array:
    """Return the terms of the quadratic (nz, nx, 5)."""
    zz, xx = np.meshgrid(z, x, indexing='ij')
    return np.stack([xx, zz, xx * xx, xx * zz, zz * zz], axis=-1)


def _quadratic(coefficients: Array, z: Array, x: Array) -> Array:
    """Return the quadratic (nz, nx) with coefficients (5,), without storing its terms."""
    z = z[:, None]
    a = coefficients
    return z * (a[1] + a[4] * z) + x * (a[0] + a[2] * x) + a[3] * (z * x)


def _fit(log_ratio: Array, terms: Array, weight: Array) -> tuple[Array, Array]:
    """Return the constants (3,) and the coefficients of the quadratic (5,), by least squares."""
    total = weight.sum()
    mean_terms = np.tensordot(weight, terms, 2) / total
    centred = (terms - mean_terms).reshape(-1, terms.shape[-1])
    weighted = centred * weight.reshape(-1, 1)
    matrix = weighted.T @ centred / total
    right = weighted.T @ channel_mean(log_ratio).ravel() / total
    size = max(float(np.trace(matrix)), SMALLEST_DIVISOR)  # a single cell has no shape
    penalty = _SHAPE_PENALTY * np.eye(matrix.shape[0]) * size
    coefficients = np.linalg.solve(matrix + penalty, right)
    flat = log_ratio - (terms @ coefficients)[..., None]
    return np.tensordot(weight, flat, 2) / total, coefficients
