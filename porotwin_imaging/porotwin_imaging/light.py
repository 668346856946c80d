"""The light's drift between baseline and photograph, and its removal.

Lamps warm up, daylight moves: a photograph is brighter or darker than its baseline by a factor that
varies slowly over the rig. The colour checker shows the drift of each channel at its place; sand
without tracer shows how it varies over the rig. Both work on log ratios to the baseline, where the
drift is a sum: a constant for each channel, and a quadratic in x and z that all channels share.
Tracer is told from light by robust weights: it only darkens, and by more than light drifts.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

LEAST_BACKGROUND = 0.1
"""Share of the seen cells that must be free of tracer for the sand to show the drift."""
TOLERANCE = 0.06
"""Log ratio from the drift at which a cell no longer counts as background (Tukey's biweight)."""
REACH = 0.25
"""Largest difference of log ratio between the checker and the sand that is taken for light."""
ROUNDS = 6
"""Reweightings before the surroundings of tracer are left out, and after."""
MOST_CELLS = 12_000
"""The drift varies slowly: of a finer map a regular subset of cells is enough."""
_BIN = 0.01


@dataclass(frozen=True)
class Light:
    """`log_gain` (nz, nx, 3): log of the photograph's light relative to the baseline's.

    `background`: share of the seen cells it was read from; 0 when only the checker shows it.
    """

    log_gain: Array
    background: float


def drift(log_ratio: Array, weight: Array, checker_gain: Array | None) -> Light:
    """Return the drift of light seen in log ratios (nz, nx, 3) of photograph to baseline.

    `weight` (nz, nx): 0 where a cell is not seen; `checker_gain` (3,): log gain at the checker.
    """
    grid = log_ratio.shape[:2]
    stride = max(1, round(np.sqrt(weight.size / MOST_CELLS)))
    subset = (slice(stride // 2, None, stride), slice(stride // 2, None, stride))
    log_ratio, weight = log_ratio[subset], weight[subset]
    terms = _terms(*(place[cells] for place, cells in zip(_places(grid), subset, strict=True)))
    start = _level(log_ratio, weight, checker_gain)
    constants, shape = start, np.zeros(terms.shape[-1])
    share = 0.0
    seen = weight > 0
    background = np.zeros_like(weight)
    for step in range(2 * ROUNDS):
        left = log_ratio - constants - (terms @ shape)[..., None]
        distance = np.sqrt((left**2).mean(axis=2)) / TOLERANCE
        background = weight * np.clip(1.0 - distance**2, 0.0, None) ** 2
        if step >= ROUNDS:
            background = background * _away_from_tracer(left.mean(axis=2))
        share = float((background > 0).sum() / max(1, seen.sum()))
        if share < LEAST_BACKGROUND:
            break
        constants, shape = _fit(log_ratio, terms, background)
    if share < LEAST_BACKGROUND:
        gain = np.zeros(3) if checker_gain is None else checker_gain
        return Light(np.broadcast_to(gain, (*grid, 3)), 0.0)
    slope = _quadratic(shape, *_places(grid)).astype(np.float32)
    return Light(constants.astype(np.float32) + slope[..., None], share)


def _away_from_tracer(left: Array) -> Array:
    """Return 1 where no tracer is near, else 0: its faint rim would pass for dimmer light."""
    smooth = cv2.blur(left, (3, 3))
    spread = 1.4826 * np.median(np.abs(smooth - np.median(smooth)))
    dark = (smooth < -5.0 * spread - 0.01).astype(np.uint8)
    dark = cv2.morphologyEx(dark, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    reach = 2 * max(2, left.shape[1] // 25) + 1
    return 1.0 - cv2.dilate(dark, np.ones((reach, reach), np.uint8))


def _level(log_ratio: Array, weight: Array, checker_gain: Array | None) -> Array:
    """Return where to start (3,): the commonest log ratio of the sand near the checker's."""
    expected = np.zeros(3) if checker_gain is None else checker_gain
    values = log_ratio[weight > 0]
    if not len(values):
        return expected
    grey = values.mean(axis=1)
    edges = np.arange(expected.mean() - REACH, expected.mean() + REACH + _BIN, _BIN)
    counts = np.histogram(grey, edges)[0]
    counts = np.convolve(counts, np.ones(3), mode='same')
    middle = 0.5 * (edges[:-1] + edges[1:])[int(np.argmax(counts))]
    near = np.abs(grey - middle) < 2 * _BIN
    return np.median(values[near], axis=0) if near.any() else expected


def _places(grid: tuple[int, int]) -> tuple[Array, Array]:
    """Return where rows and columns lie, from -1 to 1."""
    return np.linspace(-1, 1, grid[0]), np.linspace(-1, 1, grid[1])


def _terms(z: Array, x: Array) -> Array:
    """Return the terms of the quadratic (nz, nx, 5)."""
    zz, xx = np.meshgrid(z, x, indexing='ij')
    return np.stack([xx, zz, xx * xx, xx * zz, zz * zz], axis=-1)


def _quadratic(shape: Array, z: Array, x: Array) -> Array:
    """Return the quadratic (nz, nx) with coefficients `shape` (5,), without storing its terms."""
    z = z[:, None]
    return z * (shape[1] + shape[4] * z) + x * (shape[0] + shape[2] * x) + shape[3] * (z * x)


def _fit(log_ratio: Array, terms: Array, weight: Array) -> tuple[Array, Array]:
    """Return the channels' constants (3,) and the common quadratic (5,), by least squares."""
    total = weight.sum()
    mean_terms = np.tensordot(weight, terms, 2) / total
    centred = (terms - mean_terms).reshape(-1, terms.shape[-1])
    weighted = centred * weight.reshape(-1, 1)
    matrix = weighted.T @ centred / total
    right = weighted.T @ log_ratio.mean(axis=2).ravel() / total
    shape = np.linalg.solve(matrix + 1e-3 * np.eye(matrix.shape[0]) * np.trace(matrix), right)
    flat = log_ratio - (terms @ shape)[..., None]
    return np.tensordot(weight, flat, 2) / total, shape
