"""Whether each part of a photograph still shows the sand of the baseline.

Tracer and light change the brightness of grains, not their pattern. Where the pattern within cells
is no longer that of the baseline, something is in front of the sand or the file is damaged there,
and its darkness is no tracer.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.cell_sums import CellSums

Array = NDArray[Any]

LEAST_CORRELATION = 0.25
"""Correlation with the baseline's grains below which they are not the same: behind the strongest
tracer of the real photographs it is 0.3, on a hand or in a damaged file it is about 0."""
LEAST_TEXTURE = 0.02
"""Grains' contrast in the baseline below which there is no pattern to recognise."""
WINDOWS_ACROSS = 40
"""Patterns are compared in windows of this share of the rig's width."""


def hidden(sums: CellSums) -> NDArray[np.bool_]:
    """Return where (nz, nx) the grains are not those of the baseline.

    The `sums` are over cells or blocks of them that hold a few samples each way.
    """
    parts = [sums.state_square, sums.product, sums.baseline_square, sums.state, sums.baseline]
    seen = sums.share > 0.5
    share = np.maximum(sums.share, 0.5)[..., None]
    state_square, product, baseline_square, state, baseline = (part / share for part in parts)
    size = max(5, sums.share.shape[1] // WINDOWS_ACROSS) | 1
    joint = _pooled(product - state * baseline, seen, size)
    own = _pooled(state_square - state**2, seen, size)
    before = _pooled(baseline_square - baseline**2, seen, size)
    bright = _pooled(baseline**2, seen, size)
    correlation = joint / np.sqrt(np.maximum(own * before, 1e-14))
    textured = before > LEAST_TEXTURE**2 * bright
    lost = (seen & textured & (correlation < LEAST_CORRELATION)).astype(np.uint8)
    # a thin front of tracer in smooth sand outweighs the pattern as well: only broad places count
    lost = cv2.morphologyEx(lost, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    reach = (size + 2, size + 2)
    return cv2.dilate(lost, np.ones(reach, np.uint8)).astype(bool) & seen


def _pooled(moment: Array, seen: NDArray[np.bool_], size: int) -> Array:
    """Return a moment (nz, nx, 3) summed over channels and windows of seen cells."""
    return np.asarray(cv2.blur(moment.sum(axis=2) * seen, (size, size)))
