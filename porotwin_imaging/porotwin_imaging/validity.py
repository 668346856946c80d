"""Where a photograph of the rig can say something about tracer, judged from the baseline.

Nothing can be read off frames and deep shadow, glare, the colour checker, the water that stands
above the sand with the bolts in it, and tubes or thermocouples in front of the sand. The masks are
made once per baseline on the sampling grid (finer than the map), top row first; glare is looked for
in every photograph.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Mask = NDArray[np.bool_]

LEAST_LIGHT = 0.012
"""Linear brightness below which a sample is frame or deep shadow."""
GLARE = 0.955
"""Linear value (grey level 250) from which a channel is over-exposed."""
SMOOTH = 0.25
"""Texture, relative to the rig's median, below which there is water and no sand."""
DETECTION_COLUMNS = 900
"""Width of the picture on which objects are looked for; a tube of 1/400 of the rig is seen."""
OBJECT_SEED, OBJECT_EDGE = 6.0, 3.0
"""Deviations from the colour of the surrounding sand at which an object is seen, and ends."""
SMALLEST_OBJECT_M = 0.03
"""Objects shorter than this are grains [m]."""


@dataclass(frozen=True)
class Validity:
    """Masks on the sampling grid, True where the named thing hides the sand."""

    unlit: Mask
    checker: Mask
    water: Mask
    objects: Mask

    @property
    def usable(self) -> Mask:
        """Where nothing hides the sand."""
        return ~(self.unlit | self.checker | self.water | self.objects)


def judge(colours: Array, *, width: float, checker: Array | None) -> Validity:
    """Return what hides the sand in a baseline.

    `colours` (rows, columns, 3): linear light on the sampling grid; `width` of the rig [m];
    `checker` (4, 2): the chart's corners as (column, row) on that grid, None where it hangs
    outside.
    """
    unlit = ~lit(colours)
    scale = min(1.0, DETECTION_COLUMNS / colours.shape[1])
    small = cv2.resize(colours, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    shape = colours.shape[:2]
    water = _enlarged(_water(small), shape)
    hidden = cv2.resize(
        (unlit | water).astype(np.uint8), small.shape[1::-1], interpolation=cv2.INTER_NEAREST
    )
    objects = _enlarged(_objects(small, hidden.astype(bool), width), shape)
    return Validity(unlit, _polygon(checker, shape), water, objects)


def lit(colours: Array) -> Mask:
    """Return where the linear `colours` (rows, columns, 3) are neither dark nor over-exposed."""
    smooth = cv2.blur(colours, (9, 9))
    return (smooth.mean(axis=2) > LEAST_LIGHT) & (colours.max(axis=2) < GLARE)


def _polygon(corners: Array | None, shape: tuple[int, int]) -> Mask:
    """Return the chart with its frame: its corners moved out by a third."""
    mask = np.zeros(shape, np.uint8)
    if corners is not None:
        middle = corners.mean(axis=0)
        outer = middle + 1.35 * (corners - middle)
        cv2.fillPoly(mask, [np.rint(outer).astype(np.int32)], 1)
    return mask.astype(bool)


def texture(colours: Array) -> Array:
    """Return the spread of brightness between neighbouring grains, relative to the brightness."""
    grey = colours.mean(axis=2)
    grains = grey - cv2.GaussianBlur(grey, (0, 0), 2)
    size = (11, 11)
    return np.sqrt(np.maximum(cv2.blur(grains**2, size), 0.0)) / (cv2.blur(grey, size) + 1e-3)


def _water(colours: Array) -> Mask:
    """Return the band between the rig's top and the sand's surface, bolts included.

    Water is smooth where sand has grains. The surface in each column is the strongest
    unbroken edge of colour below the smooth band along the top.
    """
    rough = texture(colours)
    rows, columns = rough.shape
    smooth = (rough < SMOOTH * np.median(rough)).astype(np.uint8)
    smooth = cv2.morphologyEx(smooth, cv2.MORPH_OPEN, np.ones((7, 7), np.uint8))
    top = rows // 5
    count, labels, stats, _ = cv2.connectedComponentsWithStats(smooth)
    band = np.zeros_like(smooth)
    for label in range(1, count):
        _, upper, wide, _, area = stats[label]
        if upper < top and wide > columns // 8 and area > wide * 5:
            band[labels == label] = 1
    if band.any(axis=0).mean() < 0.5:
        return np.zeros(rough.shape, bool)
    depth = np.where(band.any(axis=0), rows - 1 - np.argmax(band[::-1], axis=0), -1)
    known = depth >= 0
    depth = np.interp(np.arange(columns), np.flatnonzero(known), depth[known])
    surface = _surface(colours, depth)
    return np.arange(rows)[:, None] <= surface[None, :]


def _surface(colours: Array, depth: Array) -> Array:
    """Return the rows of the sand's surface: the strongest unbroken edge of colour below `depth`.

    Of all lines from side to side that go up or down by at most a row from column to column and
    stay within an eighth of the height below `depth` (objects in the water hide more of it), the
    one along which colour changes most, found by dynamic programming.
    """
    rows, columns = colours.shape[:2]
    lag = 3
    logs = np.log(cv2.blur(colours, (9, 1)) + 1e-3)
    change = np.zeros((rows, columns), np.float32)
    change[lag:-lag] = np.abs(logs[2 * lag :] - logs[: -2 * lag]).sum(axis=2)
    below = np.arange(rows)[:, None] - depth[None, :]
    change = np.where((below >= 0) & (below <= rows // 8), np.minimum(change, 3.0), -3.0)
    total = change.copy()
    came_from = np.zeros((rows, columns), np.int8)
    for column in range(1, columns):
        before = total[:, column - 1]
        choices = np.stack([np.roll(before, 1), before, np.roll(before, -1)])
        came_from[:, column] = choices.argmax(axis=0) - 1
        total[:, column] += choices.max(axis=0)
    surface = np.empty(columns, np.float32)
    row = int(total[:, -1].argmax())
    for column in range(columns - 1, -1, -1):
        surface[column] = row
        row = min(max(row + came_from[row, column], 0), rows - 1)
    covered = cv2.dilate(surface[None, :], np.ones((1, 9), np.uint8))
    return np.asarray(covered)[0] + 2 * lag


def _objects(colours: Array, hidden: Mask, width: float) -> Mask:
    """Return tubes and the like: connected places whose colour is not that of the sand around."""
    logs = np.log(cv2.blur(colours, (3, 3)) + 1e-3)
    hue = np.stack([logs[..., 2] - logs[..., 1], logs[..., 0] - logs[..., 1]], axis=-1)
    deviation = _deviation(hue)
    deviation[hidden] = 0.0
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (deviation > OBJECT_EDGE).astype(np.uint8), connectivity=8
    )
    least = SMALLEST_OBJECT_M / width * colours.shape[1]
    seeds = np.bincount(labels[deviation > OBJECT_SEED], minlength=count)
    length = np.hypot(stats[:, 2], stats[:, 3])
    chosen = (length >= max(least, 6.0)) & (seeds >= 0.2 * stats[:, 4]) & (seeds >= 6)
    chosen[0] = False
    return cv2.dilate(chosen[labels].astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)


def _deviation(hue: Array) -> Array:
    """Return how far the hue (rows, columns, 2) lies from that of the sand around, in its spreads.

    The sand around is what fills most of a window: the one in the middle or one beside it, since
    close to an interface the middle one may hold mostly the other sand.
    """
    size = 41
    planes = [np.ascontiguousarray(hue[..., i], np.float32) for i in range(2)]
    around = [_local_median(plane, size) for plane in planes]
    spread = [
        1.4826 * _local_median(np.abs(plane - middle), size)
        for plane, middle in zip(planes, around, strict=True)
    ]
    spread = [np.maximum(one, 0.5 * np.median(one)) for one in spread]
    nearest = np.full(hue.shape[:2], np.inf, np.float32)
    for down, right in ((0, 0), (size // 2, 0), (-size // 2, 0), (0, size // 2), (0, -size // 2)):
        squares = [
            ((plane - _beside(middle, down, right)) / _beside(one, down, right)) ** 2
            for plane, middle, one in zip(planes, around, spread, strict=True)
        ]
        nearest = np.minimum(nearest, sum(squares))
    return np.sqrt(nearest)


def _beside(plane: Array, down: int, right: int) -> Array:
    """Return `plane` moved by so many rows and columns, its edges repeated."""
    rows = np.clip(np.arange(plane.shape[0]) + down, 0, plane.shape[0] - 1)
    columns = np.clip(np.arange(plane.shape[1]) + right, 0, plane.shape[1] - 1)
    return plane[np.ix_(rows, columns)]


def _local_median(plane: Array, size: int) -> Array:
    """Return the median over size x size places, found on 8 bits of the plane's central range."""
    low, high = np.percentile(plane, [0.5, 99.5])
    levels = np.clip((plane - low) / max(high - low, 1e-6) * 255, 0, 255).astype(np.uint8)
    return cv2.medianBlur(levels, size) / 255.0 * (high - low) + low


def _enlarged(mask: Mask, shape: tuple[int, int]) -> Mask:
    return cv2.resize(
        mask.astype(np.uint8), (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST
    ).astype(bool)
