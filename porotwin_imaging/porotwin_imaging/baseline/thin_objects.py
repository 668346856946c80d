"""Thin objects in front of the sand: tubes, cables and sensors laid there after the baseline.

An object much thinner than the windows in which grains are compared (`validity.py`) hides a part of
each block of cells that it crosses. Inside such a block, the ratio of the photograph to the
baseline scatters much more than around it. The edge of a plume scatters as well, but no more than
the step between the blocks on its two sides explains: a step of size D inside a block has at most
the variance D^2 / 4. Objects are long and thin, noise is not.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT, BlockSums
from porotwin_imaging.numerics.robust_statistics import TOP_PERCENTILE
from porotwin_imaging.tracer.tracer_signal import LEAST_RATIO


@dataclass(frozen=True)
class ThinObjectSettings:
    """Tubes and cables that were laid before the sand after the baseline (`thin_objects.py`)."""

    core: float = 6.0
    """Scatter in a block relative to its surroundings that shows an object [-]; half of it in the
    blocks between."""
    least_length: float = 14.0
    """Length of an object [blocks]. In ordinary photographs blocks join to at most 11."""
    least_seeds: float = 0.5
    """Blocks above `core` per block of its length [-]."""


THIN_OBJECTS = ThinObjectSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_AROUND = 15
"""Blocks across the surroundings whose median scatter is the ordinary one."""
_LEAST_SCATTER = 1e-4
"""The ordinary scatter is raised to this relative variance: no camera has less noise than 1 %."""


def thin_objects(blocks: BlockSums) -> Mask:
    """Return the blocks (rows, columns) that a thin object crosses, with their surroundings."""
    judged = blocks.share > VALIDITY.least_judged_share
    nothing = np.zeros(judged.shape, bool)
    if not judged.any():
        return nothing
    scatter, step = _scatter_and_step(blocks, judged)
    unusual = scatter / _ordinary(scatter, judged)
    unexplained = scatter / np.maximum(step**2 / 4.0, SMALLEST_DIVISOR)
    edge, core = (
        judged & (unusual > limit) & (unexplained > limit / 2)
        for limit in (THIN_OBJECTS.core / 2, THIN_OBJECTS.core)
    )
    joined = cv2.morphologyEx(edge.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    length = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    seeds = np.bincount(labels[core], minlength=count)
    chosen = (length >= THIN_OBJECTS.least_length) & (seeds >= THIN_OBJECTS.least_seeds * length)
    chosen[0] = False
    if not chosen.any():
        return nothing
    wide = cv2.dilate(chosen[labels].astype(np.uint8), np.ones((3, 3), np.uint8))
    return np.asarray(cv2.morphologyEx(wide, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))) > 0


def _scatter_and_step(blocks: BlockSums, judged: Mask) -> tuple[Array, Array]:
    """Return the relative variance of samples about the ratio of their block, and the largest
    step of the log ratio between neighbouring blocks."""
    share = np.maximum(blocks.share, VALIDITY.least_judged_share)[..., None]
    state, before = blocks.state / share, blocks.baseline / share
    ratio = state / np.maximum(before, SMALLEST_DIVISOR)
    variance = blocks.state_square - 2 * ratio * blocks.product + ratio**2 * blocks.baseline_square
    relative = np.maximum(variance / share, 0.0) / np.maximum(state, LEAST_LIGHT) ** 2
    scatter = np.where(judged, relative.mean(axis=2), 0.0).astype(np.float32)
    log_ratio = np.log(np.maximum(ratio.mean(axis=2), LEAST_RATIO)).astype(np.float32)
    log_ratio[~judged] = np.median(log_ratio[judged])
    around = np.ones((3, 3), np.uint8)
    return scatter, cv2.dilate(log_ratio, around) - cv2.erode(log_ratio, around)


def _ordinary(scatter: Array, judged: Mask) -> Array:
    """Return the median scatter around each block, computed with 8 bits of its square root."""
    middle = float(np.median(scatter[judged]))
    root = np.sqrt(np.where(judged, scatter, middle))
    top = max(float(np.percentile(root[judged], TOP_PERCENTILE)), SMALLEST_DIVISOR)
    levels = np.clip(root / top * 255, 0, 255).astype(np.uint8)
    median = (cv2.medianBlur(levels, _AROUND) / 255.0 * top) ** 2
    return np.maximum(median, _LEAST_SCATTER)
