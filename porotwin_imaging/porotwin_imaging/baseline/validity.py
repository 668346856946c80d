"""Validity of a map: which cells of a photograph show the sand of the baseline.

Tracer and light change the brightness of grains but not their pattern. Where the pattern differs
from the baseline, something covers the sand or the file is damaged, and the dark colour there is no
tracer. `baseline_mask.py` finds the parts that never show sand.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.baseline.thin_objects import thin_objects
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.light.light_check import SMALLEST_WINDOW
from porotwin_imaging.numerics.cell_sums import BlockSums, CellSums

Array = NDArray[Any]
Mask = NDArray[np.bool_]


def visible_cells(sums: CellSums, *, print_or_scan: bool = False) -> tuple[Mask, list[str]]:
    """Return the visible cells (nz, nx), and a remark if sand is covered or damaged.

    In a print the strongest tracer shows no grains. It looks like a thing before the sand.

    Raises:
        InputError: most of the sand is covered, or the file is damaged.
    """
    expected = sums.share > VALIDITY.least_visible_share
    if print_or_scan:
        return expected, []
    blocks = (hidden_sand(sums.blocks) | thin_objects(sums.blocks)).astype(np.uint8)
    nz, nx = sums.share.shape
    hidden = cv2.resize(blocks, (nx, nz), interpolation=cv2.INTER_NEAREST).astype(bool) & expected
    share = float(hidden.sum() / max(1, expected.sum()))
    if share > VALIDITY.most_hidden:
        raise InputError(
            f'photograph does not show the grains of the baseline on {100 * share:.0f} % of '
            'the sand: a damaged file, or something before the camera'
        )
    if not hidden.any():
        return expected, []
    remark = f'{100 * share:.1f} % of the sand is covered or damaged in the photograph: left out'
    return expected & ~hidden, [remark]


def unclipped_cells(sums: CellSums, share: Array) -> tuple[Mask, list[str]]:
    """Return the cells (nz, nx) that are not over-exposed, and a remark if some are.

    Over-exposed samples are left out of `sums`. `share` (nz, nx) is the share of each cell that the
    baseline shows.

    Raises:
        InputError: too much of the sand is over-exposed.
    """
    sand = share > VALIDITY.least_visible_share
    clipped = sand & (share - sums.share > VALIDITY.most_clipped_samples * share)
    part = float(clipped.sum() / max(1, sand.sum()))
    if part > VALIDITY.most_left_out:
        raise InputError(
            f'photograph is over-exposed on {100 * part:.0f} % of the sand; shorten the exposure'
        )
    if not clipped.any():
        return ~clipped, []
    return ~clipped, [f'{100 * part:.1f} % of the sand is over-exposed: left out']


def hidden_sand(sums: BlockSums) -> Mask:
    """Return the blocks (rows, columns) whose pattern of grains is not that of the baseline."""
    parts = [sums.state_square, sums.product, sums.baseline_square, sums.state, sums.baseline]
    judged = sums.share > VALIDITY.least_judged_share
    share = np.maximum(sums.share, VALIDITY.least_judged_share)[..., None]
    state_square, product, baseline_square, state, baseline = (part / share for part in parts)
    size = max(SMALLEST_WINDOW, sums.share.shape[1] // VALIDITY.windows_across) | 1
    covariance = _pooled(product - state * baseline, judged, size)
    state_variance = _pooled(state_square - state**2, judged, size)
    baseline_variance = _pooled(baseline_square - baseline**2, judged, size)
    brightness = _pooled(baseline**2, judged, size)
    scatter = np.sqrt(np.maximum(state_variance * baseline_variance, 0.0))
    correlation = covariance / np.maximum(scatter, SMALLEST_DIVISOR)
    textured = baseline_variance > VALIDITY.least_texture**2 * brightness
    differs = (judged & textured & (correlation < VALIDITY.least_correlation)).astype(np.uint8)
    # a thin front of tracer in smooth sand also hides the pattern: only wide places count
    differs = cv2.morphologyEx(differs, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    reach = (size + 2, size + 2)
    return cv2.dilate(differs, np.ones(reach, np.uint8)).astype(bool) & judged


def _pooled(moment: Array, judged: Mask, size: int) -> Array:
    """Return a moment (nz, nx, 3) summed over channels and averaged over windows."""
    return np.asarray(cv2.blur(moment.sum(axis=2) * judged, (size, size)))
