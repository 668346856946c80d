"""Sands: their segmentation in the baseline, and one factor on the signal of each.

The same tracer gives another signal in another sand. Each sand is assumed to be uniform and gets
one factor. The factors minimise the jumps of the signal at the interfaces between sands, in the
least squares sense (paper, sec. 2.2.1), at places with signal on both sides.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.settings import DEFAULTS, SandSettings

Array = NDArray[Any]
Labels = NDArray[np.uint8]

_CLUSTERING_SEED = 7
"""Fixed seed of the k-means clustering, so that a calibration can be repeated."""
_CLUSTERING_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_CLUSTERING_TRIALS = 3
_BRIGHTNESS_WEIGHT = 1.5
"""Weight of brightness against texture and hue; brightness is the sharpest feature."""
_LEAST_LIGHT, _LEAST_TEXTURE = 1e-4, 1e-3
"""Light and texture are raised to these before the logarithm."""
_ROBUST_ROUNDS, _SMALLEST_JUMP = 20, 0.02
"""Rounds of the fit of least absolute jumps; smaller jumps [log] have a constant weight."""
_FACTOR_PENALTY = 1e-3
"""Keeps the factor of sands without pairs at 1."""
_STRONG_PERCENTILE, _STRONG_CELLS = 99.5, 50
"""Percentile for the strongest signal of a sand, and the cells needed for it."""


@dataclass(frozen=True)
class SandFactors:
    """The factors that make the signal continuous between sands.

    Attributes:
        values: factor of each sand, 1 for the sand with most pairs.
        pairs: pairs of cells that determined each factor.
        jump_before: median absolute log jump between sands without the factors.
        jump_after: the same with the factors.
    """

    values: tuple[float, ...]
    pairs: tuple[int, ...]
    jump_before: float
    jump_after: float


def segment(
    colours: Array,
    texture: Array,
    visible: NDArray[np.bool_],
    settings: SandSettings = DEFAULTS.sands,
) -> Labels:
    """Return the index of the sand in each cell, uint8, shape (nz, nx), the largest sand first.

    The features are the logarithms of texture, of brightness without the variation of the lamps,
    and of the share of blue. K-means finds more classes than there are sands; then classes closer
    than `settings.separation` are merged. Hidden cells take the nearest sand.

    Args:
        colours: linear colours of the baseline, shape (nz, nx, 3).
        texture: texture of the baseline, shape (nz, nx).
        visible: cells that show sand, shape (nz, nx).
        settings: thresholds.
    """
    if visible.sum() < settings.fewest_cells:
        return np.zeros(visible.shape, np.uint8)
    mean = np.maximum(colours.mean(axis=2), _LEAST_LIGHT)
    brightness, rough = np.log(mean), np.log(np.maximum(texture, _LEAST_TEXTURE))
    blue = np.log(np.maximum(colours[..., 2], _LEAST_LIGHT) / mean)
    # texture and hue hardly depend on the lamps, so that these classes separate sand from light
    first = np.zeros(visible.shape, int)
    first[visible] = _clustered([rough, blue], visible, settings)[1]
    even = brightness - _lamps(brightness, first, visible, settings)
    values, classes = _clustered([rough, _BRIGHTNESS_WEIGHT * even, blue], visible, settings)
    labels = np.zeros(visible.shape, np.uint8)
    labels[visible] = _merged(values, classes, settings)
    tidy = _tidy(labels, visible, settings)
    return _tidy(_sharpened(tidy, colours, visible, settings), visible, settings)


def _clustered(
    planes: list[Array], visible: NDArray[np.bool_], settings: SandSettings
) -> tuple[Array, Array]:
    """Return the features (n, k) of the visible cells and their classes (n,) by k-means."""
    blurred = [_masked_median(plane.astype(np.float32), visible) for plane in planes]
    values = np.stack(blurred, axis=-1)[visible].astype(np.float32)
    classes = np.zeros((len(values), 1), np.int32)
    cv2.setRNGSeed(_CLUSTERING_SEED)
    cv2.kmeans(
        values,
        settings.most_sands,
        classes,
        _CLUSTERING_CRITERIA,
        _CLUSTERING_TRIALS,
        cv2.KMEANS_PP_CENTERS,
    )
    return values, classes[:, 0]


def _lamps(
    brightness: Array, classes: Array, visible: NDArray[np.bool_], settings: SandSettings
) -> Array:
    """Return the smooth part (nz, nx) of log brightness, a quadratic common to all classes."""
    rows, columns = np.indices(visible.shape)
    u, v = columns / visible.shape[1] - 0.5, rows / visible.shape[0] - 0.5
    smooth = np.stack([u, v, u * u, u * v, v * v], axis=-1)
    members = classes[visible][:, None] == np.arange(settings.most_sands)
    design = np.column_stack([members, smooth[visible]])
    found = np.linalg.lstsq(design, brightness[visible], rcond=None)[0]
    return smooth @ found[settings.most_sands :]


def _masked_median(plane: Array, visible: NDArray[np.bool_]) -> Array:
    """Return the local median, which keeps interfaces sharp; hidden cells are filled first."""
    filled: Array = np.where(visible, plane, np.median(plane[visible])).astype(np.float32)
    for _ in range(2):
        filled = cv2.medianBlur(filled, 5)
    return filled


def _merged(values: Array, classes: Array, settings: SandSettings) -> Array:
    """Return the classes (n,) with overlapping ones merged, numbered by decreasing size."""
    parent = list(range(settings.most_sands))
    while True:
        ids = sorted(set(parent))
        spread = {i: values[np.isin(classes, _members(parent, i))].std(axis=0) for i in ids}
        middle = {i: np.median(values[np.isin(classes, _members(parent, i))], axis=0) for i in ids}
        distance = {
            (a, b): float(
                np.linalg.norm(
                    (middle[a] - middle[b])
                    / np.maximum(0.5 * (spread[a] + spread[b]), settings.least_spread)
                )
            )
            for a, b in combinations(ids, 2)
        }
        if not distance:
            break
        (a, b), nearest = min(distance.items(), key=lambda item: item[1])
        if nearest >= settings.separation:
            break
        parent = [a if p == b else p for p in parent]
    sizes = {i: np.isin(classes, _members(parent, i)).sum() for i in set(parent)}
    order = {i: rank for rank, i in enumerate(sorted(sizes, key=lambda i: -sizes[i]))}
    return np.array([order[parent[c]] for c in classes], dtype=np.uint8)


def _members(parent: list[int], root: int) -> list[int]:
    """Return the original classes that were merged into `root`."""
    return [i for i, p in enumerate(parent) if p == root]


def _tidy(labels: Labels, visible: NDArray[np.bool_], settings: SandSettings) -> Labels:
    """Return the labels with small patches and hidden cells merged into the surrounding sand."""
    keep = np.zeros(labels.shape, bool)
    least = max(4, int(settings.smallest_share * labels.size))
    for label in np.unique(labels[visible]):
        _, parts, stats, _ = cv2.connectedComponentsWithStats(
            ((labels == label) & visible).astype(np.uint8), connectivity=4
        )
        large = stats[:, cv2.CC_STAT_AREA] >= least
        large[0] = False
        keep |= large[parts]
    if not keep.any():
        return np.zeros_like(labels)
    _, nearest = cv2.distanceTransformWithLabels(
        (~keep).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(nearest.max() + 1, np.uint8)
    source[nearest[keep]] = labels[keep]
    tidy = source[nearest]
    _, tidy = np.unique(tidy, return_inverse=True)
    return tidy.reshape(labels.shape).astype(np.uint8)


def _sharpened(
    labels: Labels, colours: Array, visible: NDArray[np.bool_], settings: SandSettings
) -> Labels:
    """Return the labels with interfaces moved to the edges of brightness.

    Texture locates an interface only to within its window. A watershed grows the sands from their
    certain parts; they meet at the strongest edge.
    """
    if labels.max() == 0:
        return labels
    kernel = np.ones((2 * settings.interface_reach_cells + 1,) * 2, np.uint8)
    near = (cv2.dilate(labels, kernel) != cv2.erode(labels, kernel)) & visible
    markers = np.where(near, 0, labels.astype(np.int32) + 1)
    logs = cv2.medianBlur(np.log(np.maximum(colours, _LEAST_LIGHT)).astype(np.float32), 3)
    low, high = np.percentile(logs[visible], [1, 99], axis=0)
    picture = np.clip((logs - low) / np.maximum(high - low, 1e-3) * 255, 0, 255).astype(np.uint8)
    grown = cv2.watershed(picture, np.ascontiguousarray(markers, np.int32)) - 1
    unknown = grown < 0
    grown[unknown] = labels[unknown]
    return np.asarray(cv2.medianBlur(grown.astype(np.uint8), 3), np.uint8)


def fit_factors(
    signals: list[Array], labels: Labels, settings: SandSettings = DEFAULTS.sands
) -> SandFactors:
    """Return the factors that make the signals continuous at interfaces.

    A pair is two cells on either side of an interface, two and four cells away from it, so that
    neither contains both sands. The signal is extrapolated to the interface from both sides, so
    that a slope of concentration is no jump. With signals s_a and s_b at the interface, the log
    factors f minimise the sum of |ln s_a + f_a - ln s_b - f_b|. Sands without pairs keep 1.

    Args:
        signals: signal of each photograph, shape (nz, nx), NaN where it is not visible.
        labels: index of the sand in each cell, shape (nz, nx).
        settings: thresholds.
    """
    count = int(labels.max()) + 1
    strongest = _strongest(signals, labels, count)
    first, second, jump = _jumps(signals, labels, settings.least_signal * strongest)
    pairs = np.bincount(np.concatenate([first, second]), minlength=count)
    if len(jump) < settings.fewest_pairs:
        return SandFactors((1.0,) * count, tuple(int(n) for n in pairs), 0.0, 0.0)
    design = np.zeros((len(jump), count))
    design[np.arange(len(jump)), first] += 1.0
    design[np.arange(len(jump)), second] -= 1.0
    weight = np.ones(len(jump))
    logs: Array = np.zeros(count)
    for _ in range(_ROBUST_ROUNDS):
        normal = design.T @ (weight[:, None] * design) + _FACTOR_PENALTY * np.eye(count)
        logs = np.linalg.solve(normal, -design.T @ (weight * jump))
        residual = np.abs(jump + design @ logs)
        # weights of the least absolute jumps, because fronts of tracer are outliers
        weight = 1.0 / np.maximum(residual, _SMALLEST_JUMP)
    reference = int(np.argmax(pairs))
    logs = np.where(pairs >= settings.fewest_pairs, logs - logs[reference], 0.0)
    after = jump + design @ logs
    return SandFactors(
        tuple(float(value) for value in np.exp(logs)),
        tuple(int(n) for n in pairs),
        float(np.median(np.abs(jump))),
        float(np.median(np.abs(after))),
    )


def _strongest(signals: list[Array], labels: Labels, count: int) -> Array:
    """Return the strongest signal of each sand, infinite for sands with too few cells."""
    strongest = np.full(count, np.inf)
    for label in range(count):
        values = np.concatenate([signal[labels == label] for signal in signals])
        values = values[np.isfinite(values)]
        if len(values) > _STRONG_CELLS:
            strongest[label] = np.percentile(values, _STRONG_PERCENTILE)
    return strongest


def _jumps(signals: list[Array], labels: Labels, least: Array) -> tuple[Array, Array, Array]:
    """Return (first sand, second sand, ln s_first - ln s_second) of every pair of cells.

    `least`: smallest signal of each sand that counts.
    """
    found = []
    for axis in (0, 1):
        low, high, inner_low, inner_high, far_low, far_high = (
            _shifted(labels, axis, n, 8 - n) for n in (2, 6, 3, 5, 0, 8)
        )
        crossing = (low != high) & (inner_low == low) & (inner_high == high)
        crossing &= (far_low == low) & (far_high == high)
        for signal in signals:
            a, b, a_far, b_far = (_shifted(signal, axis, n, 8 - n) for n in (2, 6, 0, 8))
            strong = np.minimum(a, a_far) > least[low]
            strong &= np.minimum(b, b_far) > least[high]
            chosen = crossing & strong  # comparisons with NaN are False
            logs = [np.log(plane[chosen]) for plane in (a, a_far, b, b_far)]
            found.append((low[chosen], high[chosen], 2 * logs[0] - logs[1] - 2 * logs[2] + logs[3]))
    first, second, jump = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return first.astype(int), second.astype(int), jump


def _shifted(plane: Array, axis: int, start: int, end: int) -> Array:
    """Return `plane` without its first `start` and last `end` rows or columns along `axis`."""
    stop = plane.shape[axis] - end
    return plane[start:stop] if axis == 0 else plane[:, start:stop]
