"""Local light: soft shadows and lamps that the smooth drift of light does not follow.

Somebody stands beside the rig, a curtain moves, a lamp fails: a part of the photograph is darker,
and a map would show tracer there. A shadow takes the same share of red, green and blue, tracer does
not (`tracer_colour.py`). Sand without the hue of tracer therefore shows the local light. A smooth
field is fitted to it and continues below the plumes. It is used only if it is much larger than in
ordinary photographs.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.frame import LARGE_SHARE, VALIDITY, visible_means
from porotwin_imaging.light.light_drift import LIGHT
from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS, NOISE_SPREADS
from porotwin_imaging.tracer.tracer_colour import TracerColour, local_noise, split


@dataclass(frozen=True)
class LocalLightSettings:
    """Soft shadows and lamps (`local_light.py`)."""

    blocks_across: int = 140
    """Blocks of cells across the rig whose light is judged: enough for soft shadows."""
    darkest: float = 0.9
    """Blocks that are darker by more are no soft shadow [log ratio]: 40 % of the light."""
    least_change: float = 0.02
    """Missing light that no ordinary photograph has [log ratio]; there it stays below 0.01."""
    least_part: float = 0.01
    """Share of the sand without tracer that must be changed so [-]."""


LOCAL_LIGHT = LocalLightSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_BEND_PENALTY, _SLOPE_PENALTY = 0.03, 1e-4
"""Penalties on bends and slopes of the field, relative to the weight of the data of a node."""
_SMALL, _LARGE = 3, 9
"""Blocks across the windows of averaged hue."""
_EXPLAINED = 0.5
"""Share of the darkening that hue explains in pale tracer [-]."""
_WINDOW = 5
"""Blocks across a window of missing light. A window around tracer may contain it too. The field of
light has a node in each window; soft edges are a few windows wide."""
_FIELD_ERROR = 0.1
"""Standard deviation of the field relative to its largest value: measured on photographs with
known shadows [-]."""


@dataclass(frozen=True)
class LocalLight:
    """Light of parts of a photograph relative to the rest.

    Attributes:
        log_gain: log of the ratio, shape (nz, nx); 0 everywhere in ordinary photographs.
        variance: variance of `log_gain`, same shape.
        remarks: lines for the reader.
    """

    log_gain: Array
    variance: Array
    remarks: list[str]


def local_light(
    residual: Array,
    visible: Mask,
    colour: TracerColour | None,
) -> LocalLight | None:
    """Return the local light of a photograph; None if it is ordinary.

    Args:
        residual: log ratio to the baseline without the drift of light, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        colour: colour of the tracer; None if it is unknown or grey.
    """
    if colour is None:
        return None
    light, share = _blocks(residual, visible)
    seen = share > VALIDITY.least_visible_share
    grey, hue = split(light)
    tracer = colour.amount(hue)
    clean = seen & ~_near_tracer(grey, tracer, seen) & (grey > -LOCAL_LIGHT.darkest)
    if not _is_unusual(grey, clean):
        return None
    field = np.minimum(_smooth_field(grey, clean * share), LIGHT.most_brighter)
    return _local_light(field, clean, residual.shape[:2], visible)


def _blocks(residual: Array, visible: Mask) -> tuple[Array, Array]:
    """Return means over blocks of cells (rows, columns, 3), and their visible share."""
    nz, nx = visible.shape
    across = LOCAL_LIGHT.blocks_across
    return visible_means(residual, visible, (min(nz, max(4, across * nz // nx)), min(nx, across)))


def _near_tracer(grey: Array, tracer: Array, seen: Mask) -> Mask:
    """Return the blocks with tracer and their surroundings.

    Tracer is a significant hue in a small window, or one in a large window that explains most of
    the darkening there: wide and pale tracer.
    """
    noise, around = local_noise(tracer, seen), np.ones((_WINDOW, _WINDOW), np.uint8)
    strong = _average(tracer, seen, (_SMALL, _SMALL)) > NOISE_SPREADS * noise / _SMALL
    spots = cv2.morphologyEx(strong.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    strong = np.asarray(cv2.dilate(spots, around)) > 0
    rest = seen & ~strong
    amount, darkening = (_average(p, rest, (_LARGE, _LARGE)) for p in (tracer, -grey))
    pale = amount > np.maximum(NOISE_SPREADS * noise / _LARGE, _EXPLAINED * darkening)
    # ordinary photographs stay below half of the least change
    pale &= rest & (2.0 * darkening > LOCAL_LIGHT.least_change)
    return np.asarray(strong | (cv2.dilate(pale.astype(np.uint8), around) > 0))


def _average(plane: Array, chosen: Mask, window: tuple[int, int]) -> Array:
    """Return the mean of a plane over the chosen blocks of windows."""
    total = cv2.blur(chosen.astype(np.float64), window)
    sums = cv2.blur((plane * chosen).astype(np.float64), window)
    return np.asarray(sums / np.maximum(total, SMALLEST_DIVISOR))


def _is_unusual(missing: Array, clean: Mask) -> bool:
    """Return whether light is missing on a part of the sand that no ordinary photograph has."""
    if not clean.any():
        return False
    smooth = _average(missing, clean, (_WINDOW, _WINDOW))
    return float((np.abs(smooth[clean]) > LOCAL_LIGHT.least_change).mean()) > LOCAL_LIGHT.least_part


def _smooth_field(missing: Array, weight: Array) -> Array:
    """Return the smooth field (rows, columns) of missing light.

    The field is bilinear between nodes. Bends and slopes between the nodes are penalised; robust
    weights (Tukey's biweight) leave out objects with sharp edges.
    """
    rows, columns = missing.shape
    nodes = LOCAL_LIGHT.blocks_across // _WINDOW
    count = (max(4, round(nodes * rows / columns)), nodes)
    shape = sparse.kron(_hats(rows, count[0]), _hats(columns, count[1]), format='csr')
    bends, slopes = _penalties(count)
    robust = np.ones_like(missing)
    for _ in range(FEW_ROUNDS):
        data = sparse.diags((weight * robust).ravel())
        normal = shape.T @ data @ shape
        size = float(np.median(normal.diagonal()[normal.diagonal() > 0]))
        system = normal + size * (_BEND_PENALTY * bends + _SLOPE_PENALTY * slopes)
        found = spsolve(system.tocsc(), shape.T @ (data @ missing.ravel()))
        field = (shape @ found).reshape(missing.shape)
        distance = (missing - field) / LIGHT.tolerance
        robust = np.clip(1.0 - distance**2, 0.0, None) ** 2
    return np.asarray(field)


def _hats(length: int, nodes: int) -> sparse.csr_matrix:
    """Return the bilinear weights (length, nodes) of evenly spaced nodes."""
    place = np.linspace(0, nodes - 1, length)
    left = np.minimum(place.astype(int), nodes - 2)
    right = place - left
    row = np.arange(length)
    return sparse.csr_matrix(
        (
            np.concatenate([1 - right, right]),
            (np.concatenate([row, row]), np.concatenate([left, left + 1])),
        ),
        shape=(length, nodes),
    )


def _penalties(count: tuple[int, int]) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Return the squared bends and slopes of a field on `count` nodes (rows, columns)."""
    bends: list[Any] = []
    slopes: list[Any] = []
    for axis in (0, 1):
        for order, collected in ((2, bends), (1, slopes)):
            steps = sparse.csr_matrix(np.diff(np.eye(count[axis]), order, axis=0))
            parts = [sparse.identity(n) for n in count]
            parts[axis] = steps
            whole = sparse.kron(*parts, format='csr')
            collected.append(whole.T @ whole)
    return sum(bends[1:], bends[0]), sum(slopes[1:], slopes[0])


def _local_light(field: Array, clean: Mask, shape: tuple[int, int], visible: Mask) -> LocalLight:
    """Return the field on the cells (nz, nx), with its variance and remarks."""
    size = shape[::-1]
    log_gain = cv2.resize(field.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    guessed = cv2.resize((~clean).astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    deepest = float(np.abs(log_gain[visible]).max())
    variance = (_FIELD_ERROR * deepest) ** 2 * (0.25 + guessed)
    return LocalLight(log_gain, variance, _remarks(log_gain[visible]))


def _remarks(log_gain: Array) -> list[str]:
    """Return what was corrected; `log_gain` (n,) are those of the visible cells."""
    lines, unusual = [], LOCAL_LIGHT.least_change
    for changed, word in ((log_gain < -unusual, 'darker'), (log_gain > unusual, 'brighter')):
        if changed.mean() > LARGE_SHARE:
            most = 100 * abs(float(np.expm1(np.percentile(log_gain[changed], 50))))
            lines.append(
                f'{100 * changed.mean():.0f} % of the sand is {word} without the colour of tracer, '
                f'by {most:.0f} % in the median: corrected as shadow or lamp'
            )
    return lines
