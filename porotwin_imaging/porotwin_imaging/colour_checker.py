"""The Classic colour chart in a photograph: found near its known place, matched to its reference.

The chart is looked for around `rig.camera.colour_checker_px`: of all small moves, the one that
leaves its 24 patches most even inside and closest to an affine image of the published colours.
Colours are linear (sRGB's transfer curve undone), patches in the chart's order, dark skin first,
black last. A matrix fitted through them, robust to patches that are covered, in glare or
over-exposed, takes the camera's colours to the chart's.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.geometry import apply_homography

Array = NDArray[Any]

REFERENCE = np.array(
    [
        [0.1737, 0.0788, 0.0529],  # dark skin
        [0.5598, 0.2774, 0.2109],  # light skin
        [0.1042, 0.1889, 0.3289],  # blue sky
        [0.1057, 0.1508, 0.0508],  # foliage
        [0.2274, 0.2124, 0.4264],  # blue flower
        [0.1153, 0.5074, 0.4111],  # bluish green
        [0.7459, 0.2021, 0.0299],  # orange
        [0.0587, 0.1012, 0.3877],  # purplish blue
        [0.5601, 0.0802, 0.1146],  # moderate red
        [0.1092, 0.0420, 0.1381],  # purple
        [0.3328, 0.4974, 0.0426],  # yellow green
        [0.7710, 0.3579, 0.0204],  # orange yellow
        [0.0210, 0.0475, 0.2841],  # blue
        [0.0461, 0.2920, 0.0615],  # green
        [0.4462, 0.0364, 0.0406],  # red
        [0.8417, 0.5744, 0.0047],  # yellow
        [0.5223, 0.0778, 0.2893],  # magenta
        [-0.0439, 0.2337, 0.3772],  # cyan
        [0.8795, 0.8850, 0.8342],  # white 9.5
        [0.5845, 0.5922, 0.5845],  # neutral 8
        [0.3577, 0.3671, 0.3653],  # neutral 6.5
        [0.1901, 0.1909, 0.1898],  # neutral 5
        [0.0859, 0.0887, 0.0898],  # neutral 3.5
        [0.0314, 0.0315, 0.0323],  # black 2
    ]
)
"""Published colours of the Classic chart made since November 2014 (colour-science): linear sRGB,
Bradford-adapted to D65, shape (24, 3)."""

PITCH = 16
"""Distance of two patches in the straightened chart [px]."""
PATCH_SHARE = 0.8
"""Side of a patch relative to the distance of two patches."""
MARGIN = 2 * PITCH
SEARCH = int(1.25 * PITCH)
"""The chart is looked for up to this far from its known place [px of the straightened chart]."""
WORST_FIT = 0.2
"""Largest misfit of a found chart, relative to the spread of its colours."""
LEAST_SPREAD = 0.02
"""Spread of the patches' linear colours below which there is no chart but an even surface."""
OVER_EXPOSED = 0.955
"""Linear value (grey level 250) from which a patch is over-exposed."""
FEWEST_PATCHES = 4
"""Patches of which the median in a channel tells the light."""


@dataclass(frozen=True)
class Checker:
    """A chart found in a photograph.

    `patches` (24, 3): mean linear red, green, blue; `moved_px`: how far the chart lies from its
    known place, in pixels of the decoded photograph; `misfit`: distance of the patches from an
    affine image of the reference, relative to their spread.
    """

    patches: Array
    moved_px: float
    misfit: float


def _patch_boxes() -> Array:
    """Return the (column, row) centres of the patches in the straightened chart, shape (24, 2)."""
    row, column = np.divmod(np.arange(24), 6)
    return MARGIN + PITCH * (np.stack([column, row], axis=1) + PATCH_SHARE / 2)


def _straightening(corners: Array) -> Array:
    """Return the homography from the straightened chart to the photograph.

    `corners` (4, 2): dark skin, white, black, bluish green, as (column, row).
    """
    long = PITCH * (5 + PATCH_SHARE)
    short = PITCH * (3 + PATCH_SHARE)
    chart = MARGIN + np.array([[0, 0], [0, short], [long, short], [long, 0]])
    return cv2.getPerspectiveTransform(chart.astype(np.float32), corners.astype(np.float32))


def _box_means(image: Array, centres: Array, half: int) -> Array:
    """Return the means of square boxes around integer `centres` (..., 2), shape (..., channels)."""
    table = cv2.integral(image, sdepth=cv2.CV_64F).reshape(
        image.shape[0] + 1, image.shape[1] + 1, -1
    )
    low, high = centres - half, centres + half + 1
    total = (
        table[high[..., 1], high[..., 0]]
        - table[low[..., 1], high[..., 0]]
        - table[high[..., 1], low[..., 0]]
        + table[low[..., 1], low[..., 0]]
    )
    return total / (2 * half + 1) ** 2


def _misfit(patches: Array) -> Array:
    """Return the misfit of patches (..., 24, 3) to an affine image of the reference."""
    design = np.column_stack([REFERENCE, np.ones(24)])
    remainder = np.eye(24) - design @ np.linalg.pinv(design)
    left = np.linalg.norm(remainder @ patches, axis=-1)
    spread = np.linalg.norm(patches - patches.mean(axis=-2, keepdims=True), axis=-1)
    # of 24 patches the four worst do not count: one may be covered, and it bends the fit nearby
    kept = np.sort(left, axis=-1)[..., :20]
    return np.sqrt((kept**2).mean(axis=-1) / ((spread**2).mean(axis=-1) + 1e-12))


def _misfit_without_one(patches: Array) -> float:
    """Return the least misfit of patches (24, 3) when any single one may be left out."""
    found = []
    for left_out in range(24):
        kept = np.arange(24) != left_out
        design = np.column_stack([REFERENCE, np.ones(24)])[kept]
        values = patches[kept]
        rest = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        found.append(np.linalg.norm(rest) / (np.linalg.norm(values - values.mean(axis=0)) + 1e-9))
    return float(min(found))


def find(linear: Array, corners: Array) -> Checker | None:
    """Return the chart in a linear photograph (rows, columns, 3 = red, green, blue), or None.

    `corners` (4, 2): where it is expected, in pixels of this photograph.
    """
    width = int(PITCH * (5 + PATCH_SHARE)) + 2 * MARGIN
    height = int(PITCH * (3 + PATCH_SHARE)) + 2 * MARGIN
    homography = _straightening(corners)
    chart = cv2.warpPerspective(
        linear,
        homography,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    ).astype(np.float64)
    moves = np.stack(
        np.meshgrid(np.arange(-SEARCH, SEARCH + 1), np.arange(-SEARCH, SEARCH + 1)), axis=-1
    ).reshape(-1, 1, 2)
    centres = np.rint(_patch_boxes()).astype(int)[None] + moves
    half = int(PITCH * PATCH_SHARE / 2) - 2
    means = _box_means(chart, centres, half)
    uneven = _box_means(chart**2, centres, half) - means**2
    spread = ((means - means.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)) / 24
    roughness = np.sort(uneven.sum(axis=-1), axis=1)[:, :20].mean(axis=1)
    score = np.nan_to_num(_misfit(means) ** 2 + roughness / (spread + 1e-12), nan=np.inf)
    if not np.isfinite(score).any():
        return None
    # evenly coloured patches fit equally well a few pixels around: take the middle of these places
    alike = moves[score <= score.min() + 0.1 * abs(score.min()) + 1e-4, 0]
    best = int(np.argmin(((moves[:, 0] - alike.mean(axis=0)) ** 2).sum(axis=1)))
    misfit = _misfit_without_one(means[best])
    if not (misfit < WORST_FIT and means[best].std() > LEAST_SPREAD):
        return None
    middle = np.array([width / 2, height / 2])
    there = np.array(apply_homography(homography, *(middle + moves[best, 0])))
    expected = np.array(apply_homography(homography, *middle))
    return Checker(means[best], float(np.linalg.norm(there - expected)), misfit)


def fit_matrix(patches: Array, target: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return (matrix (3, 3), kept (24,)) with `patches @ matrix.T` close to `target`.

    Over-exposed patches are left out; others are weighted by Tukey's biweight of their misfit, so
    that covered or glaring ones do not pull (iteratively reweighted least squares).
    """
    usable = (patches < OVER_EXPOSED).all(axis=1) & (patches > 0).any(axis=1)
    scale = 1.0 / (target.mean(axis=1) + 0.02)
    weight = usable * scale
    for _ in range(15):
        matrix = np.linalg.lstsq(weight[:, None] * patches, weight[:, None] * target, rcond=None)[0]
        left = np.linalg.norm(scale[:, None] * (patches @ matrix - target), axis=1)
        spread = 1.4826 * np.median(left[usable]) + 1e-6
        tukey = np.clip(1.0 - (left / (4.7 * spread)) ** 2, 0.0, None)
        weight = usable * scale * tukey
    return matrix.T, usable & (tukey > 0.0)


def log_gain(patches: Array, baseline: Array) -> Array | None:
    """Return the log ratio (3,) of light at the chart to that of the baseline, channel by channel.

    The median over patches that are over-exposed in neither and not dark in the baseline: one
    covered patch, or glare on one, does not move it. None where a channel has too few of them.
    """
    usable = (patches < OVER_EXPOSED) & (baseline < OVER_EXPOSED) & (baseline > 0.05)
    if usable.sum(axis=0).min() < FEWEST_PATCHES:
        return None
    ratio = np.log(np.maximum(patches, 1e-4) / np.maximum(baseline, 1e-4))
    return np.array([np.median(ratio[usable[:, i], i]) for i in range(3)])


def plausible(matrix: Array) -> bool:
    """Return whether a matrix (3, 3) is one between two cameras: mainly its diagonal, positive."""
    diagonal = np.diag(matrix)
    beside = np.abs(matrix - np.diag(diagonal)).sum(axis=1)
    return bool((diagonal > 0.2).all() and (beside < 0.8 * diagonal).all())
