"""The mask of the baseline: where the photographs of a rig never show sand.

Masked are frames and deep shadow, glare, the colour checker, the water above the sand with the
bolts in it, and tubes or thermocouples in front of the sand. The masks are made once per baseline
on the sampling grid, which is finer than the map, with row 0 at the top. Glare is found in every
photograph again (`cell_sums.py`).
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.numerics.channels import channel_max, channel_mean
from porotwin_imaging.numerics.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.photograph.photo_file import OVER_EXPOSED


@dataclass(frozen=True)
class BaselineMaskSettings:
    """Where the baseline shows sand (`baseline_mask.py`)."""

    least_light: float = 0.012
    """Linear brightness below which a sample is frame or deep shadow [-]."""
    smooth_texture: float = 0.25
    """Texture relative to the median of the rig below which there is water instead of sand [-]."""
    detection_columns: int = 900
    """Width of the picture for the search of objects [px]; shows tubes of 1/400 of the rig."""
    object_core: float = 6.0
    """Colour deviation of the core of an object [local spreads]; its edge has half of it."""
    smallest_object_m: float = 0.03
    """Shorter objects are grains [m]."""


BASELINE_MASK = BaselineMaskSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_CHART_FRAME = 1.35
"""Ratio of the chart with its frame to its patches."""
_GRAIN_SIGMA, _GRAINS_WINDOW = 2.0, (11, 11)
"""Grains are finer than this blur; their brightness and contrast are averaged over this window
[samples]."""
LEAST_VALUE = 1e-3
"""Linear light is raised by this before it divides or its logarithm is taken.
Spreads of log colours are not smaller."""
_DEVIATION_WINDOW = 41
"""Window of the local median of colour [px of the detection picture]."""
_SEED_SHARE = 0.2
"""Core pixels of an object relative to its area: less is a grain."""
_LEAST_WATER_COLUMNS = 0.5
"""Share of the columns that must show the band of water [-]."""
_WATER_OPENING = (7, 7)
"""Smooth spots smaller than this are single large grains [px]."""
_WATER_PART = 8
"""Water starts in the upper eighth of the rig and is wider than an eighth, and the surface lies
within an eighth of the smooth band."""
_STRONGEST_EDGE = 3.0
"""Largest change of log colour that counts; stronger edges are equal."""
_SURFACE_LAG = 3
"""Colours are compared over twice this distance, because the surface is blurred [px]."""


@dataclass(frozen=True)
class BaselineMask:
    """Masks on the sampling grid, shape (rows, columns), True where something hides the sand.

    Attributes:
        unlit: frame, deep shadow or glare.
        checker: the colour chart.
        water: water above the sand.
        objects: tubes, thermocouples and similar objects.
    """

    unlit: Mask
    checker: Mask
    water: Mask
    objects: Mask

    @property
    def usable(self) -> Mask:
        """True where nothing hides the sand."""
        return ~(self.unlit | self.checker | self.water | self.objects)


def baseline_mask(
    colours: Array,
    *,
    width_m: float,
    checker: Array | None,
) -> BaselineMask:
    """Return the masks of a baseline.

    Args:
        colours: linear light on the sampling grid, shape (rows, columns, 3), row 0 at the top.
        width_m: width of the rig [m].
        checker: corners of the chart as (column, row) on the sampling grid, shape (4, 2), or None.
    """
    unlit = ~_lit(colours)
    scale = min(1.0, BASELINE_MASK.detection_columns / colours.shape[1])
    small = cv2.resize(colours, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    shape = colours.shape[:2]
    water = _enlarged(_water(small), shape)
    hidden = cv2.resize(
        (unlit | water).astype(np.uint8), small.shape[1::-1], interpolation=cv2.INTER_NEAREST
    )
    objects = _enlarged(_objects(small, hidden.astype(bool), width_m), shape)
    return BaselineMask(unlit, _chart(checker, shape), water, objects)


def _lit(colours: Array) -> Mask:
    """Return where the linear `colours` (rows, columns, 3) are neither dark nor over-exposed."""
    smooth = cv2.blur(colours, _GRAINS_WINDOW)
    bright_enough = channel_mean(smooth) > BASELINE_MASK.least_light
    return bright_enough & (channel_max(colours) < OVER_EXPOSED)


def _chart(corners: Array | None, shape: tuple[int, int]) -> Mask:
    """Return the polygon of the chart with its frame."""
    mask = np.zeros(shape, np.uint8)
    if corners is not None:
        middle = corners.mean(axis=0)
        outer = middle + _CHART_FRAME * (corners - middle)
        cv2.fillPoly(mask, [np.rint(outer).astype(np.int32)], 1)
    return mask.astype(bool)


def texture(colours: Array) -> Array:
    """Return the standard deviation of brightness between neighbouring grains over its mean.

    `colours`: linear light, shape (rows, columns, 3). The result has shape (rows, columns).
    """
    grey = channel_mean(colours)
    grains = grey - cv2.GaussianBlur(grey, (0, 0), _GRAIN_SIGMA)
    variance = np.maximum(cv2.blur(grains**2, _GRAINS_WINDOW), 0.0)
    return np.sqrt(variance) / (cv2.blur(grey, _GRAINS_WINDOW) + LEAST_VALUE)


def _water(colours: Array) -> Mask:
    """Return the band of water between the top of the rig and the surface of the sand.

    Water is smooth, sand has grains. The surface is the strongest unbroken edge of colour below the
    smooth band along the top.
    """
    rough = texture(colours)
    rows, columns = rough.shape
    smooth = (rough < BASELINE_MASK.smooth_texture * np.median(rough)).astype(np.uint8)
    smooth = cv2.morphologyEx(smooth, cv2.MORPH_OPEN, np.ones(_WATER_OPENING, np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(smooth)
    band = np.zeros_like(smooth)
    for label in range(1, count):
        _, upper, wide, *_ = stats[label]
        if upper < rows // _WATER_PART and wide > columns // _WATER_PART:
            band[labels == label] = 1
    depth = _lower_edge(band)
    known = depth >= 0
    if known.mean() < _LEAST_WATER_COLUMNS:
        return np.zeros(rough.shape, bool)
    depth = np.interp(np.arange(columns), np.flatnonzero(known), depth[known])
    surface = _surface(colours, depth)
    return np.arange(rows)[:, None] <= surface[None, :]


def _lower_edge(band: Array) -> Array:
    """Return the last row of the band in each column (columns,), -1 where there is none.

    Bolts in the water interrupt the band. Below the sand, a smooth frame goes on with it: the row
    counts above which the band covers most more rows than it leaves free.
    """
    covered = np.cumsum(np.where(band > 0, 1, -1), axis=0)
    return np.where(covered.max(axis=0) > 0, covered.argmax(axis=0), -1)


def _surface(colours: Array, depth: Array) -> Array:
    """Return the row of the sand surface in each column, shape (columns,).

    Candidates are lines from the left edge to the right edge. They move by at most one row between
    neighbouring columns and stay within an eighth of the height below `depth`, the lower edge of
    the smooth band (objects in the water may end the band early). Dynamic programming finds the
    line with the largest sum of colour changes.
    """
    rows, columns = colours.shape[:2]
    lag = _SURFACE_LAG
    logs = np.log(cv2.blur(colours, (9, 1)) + LEAST_VALUE)
    change = np.zeros((rows, columns), np.float32)
    change[lag:-lag] = np.abs(logs[2 * lag :] - logs[: -2 * lag]).sum(axis=2)
    below = np.arange(rows)[:, None] - depth[None, :]
    change = np.where(
        (below >= 0) & (below <= rows // _WATER_PART),
        np.minimum(change, _STRONGEST_EDGE),
        -_STRONGEST_EDGE,
    )
    total = change.copy()
    came_from = np.zeros((rows, columns), np.int8)
    for column in range(1, columns):
        before = np.pad(total[:, column - 1], 1, constant_values=-np.inf)
        choices = np.stack([before[:-2], before[1:-1], before[2:]])
        came_from[:, column] = choices.argmax(axis=0) - 1
        total[:, column] += choices.max(axis=0)
    surface = np.empty(columns, np.float32)
    row = int(total[:, -1].argmax())
    for column in range(columns - 1, -1, -1):
        surface[column] = row
        row += int(came_from[row, column])
    covered = cv2.dilate(surface[None, :], np.ones((1, 9), np.uint8))
    return np.asarray(covered)[0] + 2 * lag


def _objects(colours: Array, hidden: Mask, width_m: float) -> Mask:
    """Return tubes and similar objects: connected places whose colour differs from the sand."""
    logs = np.log(cv2.blur(colours, (3, 3)) + LEAST_VALUE)
    hue = np.stack([logs[..., 2] - logs[..., 1], logs[..., 0] - logs[..., 1]], axis=-1)
    deviation = _deviation(hue)
    deviation[hidden] = 0.0
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (2.0 * deviation > BASELINE_MASK.object_core).astype(np.uint8), connectivity=8
    )
    least_length = BASELINE_MASK.smallest_object_m / width_m * colours.shape[1]
    seeds = np.bincount(labels[deviation > BASELINE_MASK.object_core], minlength=count)
    length = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    chosen = (length >= least_length) & (seeds >= _SEED_SHARE * stats[:, cv2.CC_STAT_AREA])
    chosen[0] = False
    return cv2.dilate(chosen[labels].astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)


def _deviation(hue: Array) -> Array:
    """Return the distance of the hue (rows, columns, 2) from the surrounding sand, in its spreads.

    The surrounding sand is the median of a window. Windows beside the place are tried as well and
    the smallest distance counts: close to an interface, most of the central window may show the
    other sand.
    """
    size = _DEVIATION_WINDOW
    planes = [np.ascontiguousarray(hue[..., i], np.float32) for i in range(2)]
    around = [_local_median(plane, size) for plane in planes]
    spread = [
        SPREAD_PER_DEVIATION * _local_median(np.abs(plane - middle), size)
        for plane, middle in zip(planes, around, strict=True)
    ]
    spread = [np.maximum(one, max(0.5 * float(np.median(one)), LEAST_VALUE)) for one in spread]
    nearest = np.full(hue.shape[:2], np.inf, np.float32)
    for down, right in ((0, 0), (size // 2, 0), (-size // 2, 0), (0, size // 2), (0, -size // 2)):
        squares = [
            ((plane - _beside(middle, down, right)) / _beside(one, down, right)) ** 2
            for plane, middle, one in zip(planes, around, spread, strict=True)
        ]
        nearest = np.minimum(nearest, sum(squares))
    return np.sqrt(nearest)


def _beside(plane: Array, down: int, right: int) -> Array:
    """Return `plane` shifted by `down` rows and `right` columns, with repeated edges."""
    rows, columns = plane.shape
    margins = ((max(-down, 0), max(down, 0)), (max(-right, 0), max(right, 0)))
    first_row, first_column = max(down, 0), max(right, 0)
    around = np.pad(plane, margins, 'edge')
    return around[first_row : first_row + rows, first_column : first_column + columns]


def _local_median(plane: Array, size: int) -> Array:
    """Return the median over size x size pixels, computed with 8 bits over the central range."""
    low, high = np.percentile(plane, [0.5, 99.5])
    levels = np.clip((plane - low) / max(high - low, 1e-6) * 255, 0, 255).astype(np.uint8)
    return cv2.medianBlur(levels, size) / 255.0 * (high - low) + low


def _enlarged(mask: Mask, shape: tuple[int, int]) -> Mask:
    """Return the mask at the shape (rows, columns) of the sampling grid."""
    return cv2.resize(
        mask.astype(np.uint8), (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST
    ).astype(bool)
