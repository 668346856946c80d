"""The Classic colour chart: finding it in a photograph and fitting its colours.

The chart is searched around its nominal place, `rig.camera.colour_checker_px`. The best place makes
the 24 patches even inside and close to an affine image of the published colours. Colours are
linear. Patches have the order of the chart, dark skin first and black last. A colour matrix is
fitted from the colours of the camera to the published ones. The fit is robust against patches that
are covered, in glare or over-exposed.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.geometry.corners_and_lens import apply_homography
from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS, ROUNDS, SPREAD_PER_DEVIATION
from porotwin_imaging.photograph.photo_file import OVER_EXPOSED


@dataclass(frozen=True)
class ColourCheckerSettings:
    """Finding and judging the colour chart (`colour_checker.py`)."""

    worst_fit: float = 0.2
    """Largest misfit of a chart to its published colours, relative to their spread [-]."""
    least_spread: float = 0.02
    """Spread of linear colours below which the surface is even and no chart [-]."""
    least_light: float = 0.05
    """Darker patches of the baseline are not used for the gain: noise dominates them [-]."""
    fewest_patches: int = 4
    """Fewest patches per channel whose median ratio is a reliable gain."""
    darkest: float = 0.005
    """Darker patches of the baseline do not show haze [-]: a channel without light is clipped."""
    least_veil: float = 0.002
    """Haze that the chart shows [linear light]. It is below 0.001 on rendered and composed
    photographs without haze."""
    least_power: float = 0.03
    """Change of the power of the tone curve that the chart shows [-]."""
    most_power_misfit: float = 0.02
    """Scatter of the patches about another tone curve above which it is none [log ratio]."""
    least_diagonal: float = 0.2
    """Smallest plausible diagonal element of a colour matrix [-]: below, a channel is dead."""
    most_moved: float = 0.01
    """Distance of the chart from its given place, relative to the width of the photograph, above
    which camera or rig have probably moved since the corners were marked [-]. People read corners
    to 0.1 to 0.3 % of the width."""
    most_mixing: float = 0.8
    """Largest plausible sum of off-diagonal elements relative to the diagonal one [-]."""


COLOUR_CHECKER = ColourCheckerSettings()


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
"""Margin of the straightened chart, for the search of its place [px]."""
SEARCH = int(1.25 * PITCH)
"""Largest distance of the chart from its nominal place [px of the straightened chart]."""
_USED_PATCHES = 20
"""The four worst of the 24 patches do not count: one may be covered and bend the fit nearby."""
_TUKEY_CUTOFF = 4.7
"""Cut-off of Tukey's biweight in standard deviations (95 % efficiency for normal errors)."""
_EQUAL_SCORE = 0.1
"""Relative difference of scores below which two places are equally good."""


@dataclass(frozen=True)
class ColourChecker:
    """A chart found in a photograph.

    Attributes:
        patches: mean linear red, green, blue of each patch, shape (24, 3).
        moved_px: distance of the chart from its nominal place [px of the decoded photograph].
        misfit: distance of the patches from an affine image of the reference, relative to their
            spread [-].
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
    """Return the means over square boxes around integer `centres` (..., 2), (..., channels)."""
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
    projection = np.eye(24) - design @ np.linalg.pinv(design)
    residual = np.linalg.norm(projection @ patches, axis=-1)
    spread = np.linalg.norm(patches - patches.mean(axis=-2, keepdims=True), axis=-1)
    used = np.sort(residual, axis=-1)[..., :_USED_PATCHES]
    return np.sqrt((used**2).mean(axis=-1) / ((spread**2).mean(axis=-1) + 1e-12))


def _misfit_without_one(patches: Array) -> float:
    """Return the smallest misfit of patches (24, 3) over all choices of one patch to omit."""
    found = []
    for omitted in range(24):
        used = np.arange(24) != omitted
        design = np.column_stack([REFERENCE, np.ones(24)])[used]
        values = patches[used]
        residual = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        found.append(
            np.linalg.norm(residual) / (np.linalg.norm(values - values.mean(axis=0)) + 1e-9)
        )
    return float(min(found))


def find_checker(linear: Array, corners: Array) -> ColourChecker | None:
    """Return the chart in a photograph, or None if it is not there.

    Args:
        linear: linear red, green, blue, shape (rows, columns, 3).
        corners: nominal corners of the chart as (column, row), shape (4, 2): dark skin, white,
            black, bluish green.
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
    found = _best_place(chart)
    if found is None:
        return None
    patches, move = found
    misfit = _misfit_without_one(patches)
    if not (misfit < COLOUR_CHECKER.worst_fit and patches.std() > COLOUR_CHECKER.least_spread):
        return None
    middle = np.array([width / 2, height / 2])
    there = np.array(apply_homography(homography, *(middle + move)))
    expected = np.array(apply_homography(homography, *middle))
    return ColourChecker(patches, float(np.linalg.norm(there - expected)), misfit)


def _best_place(chart: Array) -> tuple[Array, Array] | None:
    """Return the patches (24, 3) at the best place in the straightened chart, and its shift (2,).

    The score is the squared misfit plus the variance inside the patches over the variance between
    them.
    """
    moves = np.stack(
        np.meshgrid(np.arange(-SEARCH, SEARCH + 1), np.arange(-SEARCH, SEARCH + 1)), axis=-1
    ).reshape(-1, 1, 2)
    centres = np.rint(_patch_boxes()).astype(int)[None] + moves
    half = int(PITCH * PATCH_SHARE / 2) - 2
    means = _box_means(chart, centres, half)
    variance = _box_means(chart**2, centres, half) - means**2
    spread = ((means - means.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)) / 24
    roughness = np.sort(variance.sum(axis=-1), axis=1)[:, :_USED_PATCHES].mean(axis=1)
    score = np.nan_to_num(_misfit(means) ** 2 + roughness / (spread + 1e-12), nan=np.inf)
    if not np.isfinite(score).any():
        return None
    # even patches fit equally well over a few pixels: take the middle of these places
    equal = moves[score <= score.min() + _EQUAL_SCORE * abs(score.min()) + 1e-4, 0]
    best = int(np.argmin(((moves[:, 0] - equal.mean(axis=0)) ** 2).sum(axis=1)))
    return means[best], moves[best, 0]


def fit_matrix(patches: Array, target: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return (matrix (3, 3), used (24,)) with `patches @ matrix.T` close to `target` (24, 3).

    `patches` (24, 3) and `target` are linear red, green and blue. Over-exposed patches
    are omitted. Tukey's biweight reduces the influence of covered patches and patches in glare
    (iteratively reweighted least squares).
    """
    usable = (patches < OVER_EXPOSED).all(axis=1) & (patches > 0).any(axis=1)
    scale = 1.0 / (target.mean(axis=1) + 0.02)  # relative errors, except in dark patches
    weight = usable * scale
    for _ in range(ROUNDS):
        matrix = np.linalg.lstsq(weight[:, None] * patches, weight[:, None] * target, rcond=None)[0]
        residual = np.linalg.norm(scale[:, None] * (patches @ matrix - target), axis=1)
        spread = SPREAD_PER_DEVIATION * np.median(residual[usable]) + 1e-6
        tukey = np.clip(1.0 - (residual / (_TUKEY_CUTOFF * spread)) ** 2, 0.0, None)
        weight = usable * scale * tukey
    return matrix.T, usable & (tukey > 0.0)


def log_gain(patches: Array, baseline: Array) -> Array | None:
    """Return the log ratio of light at the chart to the baseline, per channel, shape (3,).

    `patches` and `baseline` have shape (24, 3). The result is the median over the patches that are
    not over-exposed in either and not dark in the baseline, so that one covered patch has no
    influence. None if a channel has too few such patches.
    """
    usable = _usable(patches, baseline, COLOUR_CHECKER.least_light)
    if usable.sum(axis=0).min() < COLOUR_CHECKER.fewest_patches:
        return None
    ratio = _log_ratio(patches, baseline)
    return np.array([np.median(ratio[usable[:, i], i]) for i in range(3)])


@dataclass(frozen=True)
class ChartLight:
    """The light at the chart of a photograph, compared with the baseline.

    Attributes:
        log_gain: log ratio of the light, per channel, shape (3,).
        power: p of another tone curve of the camera, state = gain light^(1 + p); 0: the same curve.
        veil: haze over the chart, state = gain light + veil, linear light per channel, shape (3,);
            None if there is none.
        straight_gain: the log gain (3,) that is left when the curve or the haze is undone.
        scatter: by how much single places differ from the gain [log]; 0: a chart tells it surely.
        told_by: what told the light, for a remark.
    """

    log_gain: Array
    power: float
    veil: Array | None
    straight_gain: Array
    scatter: float
    told_by: str = 'the colour chart'


def chart_light(patches: Array, baseline: Array) -> ChartLight | None:
    """Return the light at the chart; `patches` and `baseline` are as in `log_gain`.

    Another tone curve and haze both change the ratio of dark and bright patches. The one that
    leaves less of the log ratios counts, in the median, so that a covered patch has little
    influence. None as in `log_gain`.
    """
    gain = log_gain(patches, baseline)
    if gain is None:
        return None
    seen = _usable(patches, baseline, COLOUR_CHECKER.darkest)
    ratio, light = _log_ratio(patches, baseline), np.log(np.maximum(baseline, 1e-4))
    bright = _usable(patches, baseline, COLOUR_CHECKER.least_light)
    power, level = _tone_curve(ratio, light, bright)
    veil, slope = _haze(patches, baseline, seen)
    even = _scatter(ratio - gain, seen)
    bent = _scatter(ratio - level - power * light, seen)
    hazy = _scatter(_log_ratio(patches, slope * np.maximum(baseline, 1e-4) + veil), seen)
    if abs(power) >= COLOUR_CHECKER.least_power and bent <= min(
        COLOUR_CHECKER.most_power_misfit, hazy
    ):
        return ChartLight(gain, power, None, level / (1.0 + power), 0.0)
    if abs(float(veil.mean())) >= COLOUR_CHECKER.least_veil and hazy < even:
        return ChartLight(gain, 0.0, veil, np.log(slope), 0.0)
    return ChartLight(gain, 0.0, None, gain, 0.0)


def _scatter(left: Array, seen: Array) -> float:
    """Return the median size of what is `left` (24, 3) of the log ratios of the `seen` patches."""
    return float(np.median(np.abs(left[seen])))


def _tone_curve(ratio: Array, light: Array, usable: Array) -> tuple[float, Array]:
    """Return power p and levels (3,) of a tone curve, ratio = level + p light, by robust lines.

    `ratio` (24, 3) are log ratios of the patches, `light` the logs of the baseline; only `usable`
    patches count. p is a slope by Theil and Sen.
    """
    from scipy.stats import theilslopes  # takes a quarter of the start of a node

    power = float(theilslopes(_about_medians(ratio, usable), _about_medians(light, usable)).slope)
    level = [np.median((ratio - power * light)[usable[:, i], i]) for i in range(3)]
    return power, np.array(level)


def _about_medians(values: Array, usable: Array) -> Array:
    """Return the usable `values` (24, 3) less the median of their channel, shape (n,)."""
    channels = [values[usable[:, i], i] for i in range(3)]
    return np.concatenate([channel - np.median(channel) for channel in channels])


def _haze(patches: Array, baseline: Array, seen: Array) -> tuple[Array, Array]:
    """Return offset and slope of state = slope light + offset for every channel, (3,) each.

    The brighter half of the patches gives the slope, the darker half the offset, both by medians.
    """
    offsets, slopes = np.zeros(3), np.ones(3)
    for i in range(3):
        state, light = patches[seen[:, i], i], baseline[seen[:, i], i]
        bright = light > np.median(light)
        for _ in range(FEW_ROUNDS):
            slopes[i] = np.median((state - offsets[i])[bright] / light[bright])
            offsets[i] = np.median((state - slopes[i] * light)[~bright])
    return offsets, np.maximum(slopes, 1e-4)


def _usable(patches: Array, baseline: Array, least_light: float) -> Array:
    """Return which patches and channels (24, 3) are neither over-exposed nor darker than that."""
    return np.asarray(
        (patches < OVER_EXPOSED) & (baseline < OVER_EXPOSED) & (baseline > least_light)
    )


def _log_ratio(patches: Array, baseline: Array) -> Array:
    return np.asarray(np.log(np.maximum(patches, 1e-4) / np.maximum(baseline, 1e-4)))


def is_plausible(matrix: Array) -> bool:
    """Return whether a colour matrix (3, 3) is mainly diagonal with positive diagonal elements."""
    diagonal = np.diag(matrix)
    mixing = np.abs(matrix - np.diag(diagonal)).sum(axis=1)
    return bool(
        (diagonal > COLOUR_CHECKER.least_diagonal).all()
        and (mixing < COLOUR_CHECKER.most_mixing * diagonal).all()
    )
