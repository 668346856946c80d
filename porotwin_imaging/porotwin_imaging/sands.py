"""Sands of different look: told apart in the baseline, and scaled so that tracer is continuous.

The same tracer looks different in another sand. Sands are taken as uniform: each gets one factor
on its signal, chosen so that the signal does not jump over the interfaces between sands, in the
least squares sense (paper, sec. 2.2.1), where there is signal on both sides.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Labels = NDArray[np.uint8]

MOST_SANDS = 6
FEWEST_CELLS = 50
SEPARATION = 3.0
"""Distance of two sands' looks, in their spreads, below which they are one sand."""
LEAST_SPREAD = 0.05
"""No sand's look is told more sharply than this: light and lens vary by so much [log]."""
SMALLEST_SHARE = 0.004
"""Patches smaller than this share of the rig go to the sand around them."""
INTERFACE_REACH = 3
"""Cells on either side of an interface within which it is looked for."""
LEAST_SIGNAL = 0.35
"""Signal on either side of an interface, relative to its sand's strongest, that counts."""
FEWEST_PAIRS = 12


@dataclass(frozen=True)
class Factors:
    """`values`: factor of each sand, 1 for the one with most tracer; `pairs`: jumps used for each;
    `jump_before`, `jump_after`: root mean square of the log jumps."""

    values: tuple[float, ...]
    pairs: tuple[int, ...]
    jump_before: float
    jump_after: float


def segment(colours: Array, texture: Array, seen: NDArray[np.bool_]) -> Labels:
    """Return which sand each cell holds, (nz, nx) from 0 up, the largest first.

    `colours` (nz, nx, 3) linear and `texture` (nz, nx) of the baseline; cells that are not `seen`
    take the nearest sand. Features are the logs of texture, of brightness without what the lamps
    vary, and of the share of blue; k-means with more classes than sands, then classes that are not
    set apart by `SEPARATION` are one.
    """
    if seen.sum() < FEWEST_CELLS:
        return np.zeros(seen.shape, np.uint8)
    mean = np.maximum(colours.mean(axis=2), 1e-4)
    brightness, rough = np.log(mean), np.log(np.maximum(texture, 1e-3))
    blue = np.log(np.maximum(colours[..., 2], 1e-4) / mean)
    # texture and hue hardly depend on the lamps: they give the classes within which to judge light
    first = _classes([rough, blue], seen)
    even = brightness - _lamps(brightness, first, seen)
    values, classes = _clustered([rough, 1.5 * even, blue], seen)
    labels = np.zeros(seen.shape, np.uint8)
    labels[seen] = _merged(values, classes)
    return _tidy(_sharpened(_tidy(labels, seen), colours, seen), seen)


def _classes(planes: list[Array], seen: NDArray[np.bool_]) -> Array:
    labels = np.zeros(seen.shape, int)
    labels[seen] = _clustered(planes, seen)[1]
    return labels


def _clustered(planes: list[Array], seen: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the features (n, k) of the seen cells and their classes (n,) by k-means."""
    blurred = [_masked_median(plane.astype(np.float32), seen) for plane in planes]
    values = np.stack(blurred, axis=-1)[seen].astype(np.float32)
    classes = np.zeros((len(values), 1), np.int32)
    cv2.setRNGSeed(7)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    cv2.kmeans(values, MOST_SANDS, classes, criteria, 3, cv2.KMEANS_PP_CENTERS)
    return values, classes[:, 0]


def _lamps(brightness: Array, classes: Array, seen: NDArray[np.bool_]) -> Array:
    """Return the smooth part of log brightness that all classes share: a quadratic in x and z."""
    rows, columns = np.indices(seen.shape)
    u, v = columns / seen.shape[1] - 0.5, rows / seen.shape[0] - 0.5
    smooth = np.stack([u, v, u * u, u * v, v * v], axis=-1)
    members = classes[seen][:, None] == np.arange(MOST_SANDS)
    design = np.column_stack([members, smooth[seen]])
    found = np.linalg.lstsq(design, brightness[seen], rcond=None)[0]
    return smooth @ found[MOST_SANDS:]


def _masked_median(plane: Array, seen: NDArray[np.bool_]) -> Array:
    """Return the local median, which keeps interfaces sharp; unseen cells take the global one."""
    filled: Array = np.where(seen, plane, np.median(plane[seen])).astype(np.float32)
    for _ in range(2):
        filled = cv2.medianBlur(filled, 5)
    return filled


def _merged(values: Array, classes: Array) -> Array:
    """Return classes from 0 up with those that overlap joined into one."""
    parent = list(range(MOST_SANDS))
    while True:
        ids = sorted(set(parent))
        spread = {i: values[np.isin(classes, _members(parent, i))].std(axis=0) for i in ids}
        middle = {i: np.median(values[np.isin(classes, _members(parent, i))], axis=0) for i in ids}
        distance = {
            (a, b): float(
                np.linalg.norm(
                    (middle[a] - middle[b])
                    / np.maximum(0.5 * (spread[a] + spread[b]), LEAST_SPREAD)
                )
            )
            for a, b in combinations(ids, 2)
        }
        if not distance:
            break
        (a, b), nearest = min(distance.items(), key=lambda item: item[1])
        if nearest >= SEPARATION:
            break
        parent = [a if p == b else p for p in parent]
    sizes = {i: np.isin(classes, _members(parent, i)).sum() for i in set(parent)}
    order = {i: rank for rank, i in enumerate(sorted(sizes, key=lambda i: -sizes[i]))}
    return np.array([order[parent[c]] for c in classes], dtype=np.uint8)


def _members(parent: list[int], root: int) -> list[int]:
    return [i for i, p in enumerate(parent) if p == root]


def _tidy(labels: Labels, seen: NDArray[np.bool_]) -> Labels:
    """Give small patches and unseen cells to the sand around them."""
    keep = np.zeros(labels.shape, bool)
    least = max(4, int(SMALLEST_SHARE * labels.size))
    for label in np.unique(labels[seen]):
        count, parts, stats, _ = cv2.connectedComponentsWithStats(
            ((labels == label) & seen).astype(np.uint8), connectivity=4
        )
        large = stats[:, cv2.CC_STAT_AREA] >= least
        large[0] = False
        keep |= large[parts]
        del count
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


def _sharpened(labels: Labels, colours: Array, seen: NDArray[np.bool_]) -> Labels:
    """Move interfaces, which texture shows only to within its window, to the edges of brightness.

    Sands grow from where they are certain towards each other and meet on the strongest edge
    (watershed).
    """
    if labels.max() == 0:
        return labels
    kernel = np.ones((2 * INTERFACE_REACH + 1,) * 2, np.uint8)
    near = (cv2.dilate(labels, kernel) != cv2.erode(labels, kernel)) & seen
    markers = np.where(near, 0, labels.astype(np.int32) + 1)
    logs = cv2.medianBlur(np.log(np.maximum(colours, 1e-4)).astype(np.float32), 3)
    low, high = np.percentile(logs[seen], [1, 99], axis=0)
    picture = np.clip((logs - low) / np.maximum(high - low, 1e-3) * 255, 0, 255).astype(np.uint8)
    grown = cv2.watershed(picture, np.ascontiguousarray(markers, np.int32)) - 1
    unknown = grown < 0
    grown[unknown] = labels[unknown]
    return np.asarray(cv2.medianBlur(grown.astype(np.uint8), 3), np.uint8)


def fit_factors(signals: list[Array], labels: Labels) -> Factors:
    """Return the factors that make `signals` (each (nz, nx), NaN unseen) continuous.

    A pair is two cells on either side of an interface, two and four cells away from it, so that
    neither mixes sands; the signal is carried on to the interface from both sides, so that a slope
    of concentration is no jump. With s_a, s_b the signals there, the log factors f minimise the sum
    of (ln s_a + f_a - ln s_b - f_b)^2, robustly; sands that no pair ties to the others keep 1.
    """
    count = int(labels.max()) + 1
    strongest = _strongest(signals, labels, count)
    first, second, jump = _jumps(signals, labels, strongest)
    pairs = np.bincount(np.concatenate([first, second]), minlength=count)
    if len(jump) < FEWEST_PAIRS:
        return Factors((1.0,) * count, tuple(int(n) for n in pairs), 0.0, 0.0)
    design = np.zeros((len(jump), count))
    design[np.arange(len(jump)), first] += 1.0
    design[np.arange(len(jump)), second] -= 1.0
    weight = np.ones(len(jump))
    logs: Array = np.zeros(count)
    for _ in range(20):
        normal = design.T @ (weight[:, None] * design) + 1e-3 * np.eye(count)
        logs = np.linalg.solve(normal, -design.T @ (weight * jump))
        left = np.abs(jump + design @ logs)
        weight = 1.0 / np.maximum(left, 0.02)  # towards least absolute jumps: fronts are outliers
    reference = int(np.argmax(np.bincount(np.concatenate([first, second]), minlength=count)))
    logs = np.where(pairs >= FEWEST_PAIRS, logs - logs[reference], 0.0)
    after = jump + design @ logs
    return Factors(
        tuple(float(value) for value in np.exp(logs)),
        tuple(int(n) for n in pairs),
        float(np.median(np.abs(jump))),
        float(np.median(np.abs(after))),
    )


def _strongest(signals: list[Array], labels: Labels, count: int) -> Array:
    """Return the signal near the top of what each sand shows."""
    strongest = np.full(count, np.inf)
    for label in range(count):
        values = np.concatenate([signal[labels == label] for signal in signals])
        values = values[np.isfinite(values)]
        if len(values) > 50:
            strongest[label] = np.percentile(values, 99.5)
    return strongest


def _jumps(signals: list[Array], labels: Labels, strongest: Array) -> tuple[Array, Array, Array]:
    """Return (first sand, second sand, ln s_first - ln s_second) of every pair with signal."""
    found = []
    for axis in (0, 1):
        low, high, inner_low, inner_high, far_low, far_high = (
            _shifted(labels, axis, n, 8 - n) for n in (2, 6, 3, 5, 0, 8)
        )
        crossing = (low != high) & (inner_low == low) & (inner_high == high)
        crossing &= (far_low == low) & (far_high == high)
        for signal in signals:
            a, b, a_far, b_far = (_shifted(signal, axis, n, 8 - n) for n in (2, 6, 0, 8))
            strong = np.minimum(a, a_far) > LEAST_SIGNAL * strongest[low]
            strong &= np.minimum(b, b_far) > LEAST_SIGNAL * strongest[high]
            chosen = crossing & strong  # NaN is never strong
            logs = [np.log(plane[chosen]) for plane in (a, a_far, b, b_far)]
            found.append((low[chosen], high[chosen], 2 * logs[0] - logs[1] - 2 * logs[2] + logs[3]))
    first, second, jump = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return first.astype(int), second.astype(int), jump


def _shifted(plane: Array, axis: int, start: int, end: int) -> Array:
    """Return `plane` without its first `start` and last `end` lines along `axis`."""
    stop = plane.shape[axis] - end
    return plane[start:stop] if axis == 0 else plane[:, start:stop]
