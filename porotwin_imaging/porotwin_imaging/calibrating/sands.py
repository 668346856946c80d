"""Sands: their segmentation in the baseline, and one factor on the signal of each.

The same tracer gives another signal in another sand. Each sand is assumed to be uniform and gets
one factor. Cores of plumes, the jumps of the signal at the interfaces between sands (paper, sec.
2.2.1) and a prior determine the factors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.baseline.baseline_mask import LEAST_VALUE
from porotwin_imaging.calibrating.calibration_evidence import FactorSource
from porotwin_imaging.calibrating.plume_core import STRONG_SHARE
from porotwin_imaging.geometry.frame import LARGE_SHARE
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT
from porotwin_imaging.numerics.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS


@dataclass(frozen=True)
class SandSettings:
    """Telling sands apart and scaling them (`sands.py`)."""

    most_sands: int = 6
    """Classes of the k-means clustering, more than the sands of a rig."""
    separation: float = 3.0
    """Distance of two classes below which they are one sand [spreads of their features]."""
    least_spread: float = 0.05
    """Smallest spread of a feature, and least jump of a channel at an edge of a sand [log]: light
    and lens alone cause this much."""
    reach_cells: int = 4
    """Texture or a description tell an interface to within this many cells, 28 mm on 2.8 m."""
    lamp_texture: float = 0.25
    """Difference of texture across an interface below which it is no edge of a sand [log]."""
    pairs_together: int = 12
    """Neighbouring pairs of cells across an interface that share one error: grains, fronts and
    labels extend over cells. Fewer do not determine a factor."""
    jump_error: float = 0.1
    """Standard deviation of the true jump of the signal at an interface, where tracer flows along
    it on one side only, and of the log factors of two parts that the rig describes as one sand:
    packing, and light that the picture does not tell from sand [log]. On composed photographs jumps
    are up to 0.17."""
    bright_slope: float = 0.6
    """Fall of the log signal of stock per log of light, for sands brighter than the reference. The
    law of Kubelka and Munk gives 0.5 to 0.8 for reflections of 0.3 to 0.6 and dye that absorbs ten
    times as much as sand; darker sands hardly follow."""
    prior_deviation: float = 0.15
    """Standard deviation of the log factors before any evidence. Those fitted to photographs of the
    large FluidFlower differ by up to 0.3 from the law, those of composed photographs by 0.09."""
    widest_factor: float = 2.5
    """Largest factor of a sand, and inverse of the smallest. Real sands differ by less than 2."""


SANDS = SandSettings()


Array = NDArray[Any]
Labels = NDArray[np.uint8]

_CLUSTERING_SEED = 7
"""Fixed seed of the k-means clustering, so that a calibration can be repeated."""
_CLUSTERING_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_CLUSTERING_TRIALS = 3
_LAMP_DEGREE = 4
"""Degree of the light of the lamps: 4 follows a lamp on each side and the corners of a lens."""
_JUMP_CELLS = (2, 6)
"""Cells between an interface and the two cells whose colours are extrapolated to it."""


@dataclass(frozen=True)
class SandLevel:
    """The signal of tracer stock in one sand, from the cores of the photographs.

    Attributes:
        level: signal of stock [-].
        deviation: its relative standard deviation [-].
        cells: cells of the cores.
    """

    level: float
    deviation: float
    cells: int


@dataclass(frozen=True)
class SandFactors:
    """The factors that make the signal the same in all sands.

    Attributes:
        values: factor of each sand, 1 for the reference sand.
        deviations: relative standard deviation of each factor [-].
        pairs: pairs of cells across the interfaces of each sand.
        sources: where each factor comes from.
        at_bound: True where the photographs ask for a factor outside the bounds.
        reference: index of the reference sand.
        jump_before: median absolute log jump between sands without the factors.
        jump_after: the same with the factors.
    """

    values: tuple[float, ...]
    deviations: tuple[float, ...]
    pairs: tuple[int, ...]
    sources: tuple[FactorSource, ...]
    at_bound: tuple[bool, ...]
    reference: int
    jump_before: float
    jump_after: float


def segment(
    colours: Array,
    texture: Array,
    visible: NDArray[np.bool_],
) -> Labels:
    """Return the index of the sand in each cell, uint8, shape (nz, nx), the largest sand first.

    The features are the logarithms of texture, of brightness without the variation of the lamps,
    and of the share of blue. K-means finds more classes than there are sands; then classes closer
    than `SANDS.separation` are merged. Hidden cells take the nearest sand.

    Args:
        colours: linear colours of the baseline, shape (nz, nx, 3).
        texture: texture of the baseline, shape (nz, nx).
        visible: cells that show sand, shape (nz, nx).
    """
    if visible.sum() < FEWEST_CELLS:
        return np.zeros(visible.shape, np.uint8)
    mean = np.maximum(colours.mean(axis=2), LEAST_LIGHT)
    brightness, rough = np.log(mean), np.log(np.maximum(texture, LEAST_VALUE))
    blue = np.log(np.maximum(colours[..., 2], LEAST_LIGHT) / mean)
    # texture and hue hardly depend on the lamps, so that these classes separate sand from light
    first = np.zeros(visible.shape, int)
    first[visible] = _clustered([rough, blue], visible)[1]
    even = brightness - _lamps(brightness, first, visible, SANDS.most_sands)
    values, classes = _clustered([rough, even, blue], visible)
    labels = np.zeros(visible.shape, np.uint8)
    labels[visible] = _merged(values, classes)
    tidy = _tidy(labels, visible)
    sharp = _tidy(_sharpened(tidy, colours, visible), visible)
    logs = np.log(np.maximum(colours, LEAST_LIGHT))
    return _tidy(_without_lamps(sharp, logs, rough, visible), visible)


def _clustered(planes: list[Array], visible: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the features (n, k) of the visible cells and their classes (n,) by k-means."""
    blurred = [_masked_median(plane.astype(np.float32), visible) for plane in planes]
    values = np.stack(blurred, axis=-1)[visible].astype(np.float32)
    classes = np.zeros((len(values), 1), np.int32)
    cv2.setRNGSeed(_CLUSTERING_SEED)
    cv2.kmeans(
        values,
        SANDS.most_sands,
        classes,
        _CLUSTERING_CRITERIA,
        _CLUSTERING_TRIALS,
        cv2.KMEANS_PP_CENTERS,
    )
    return values, classes[:, 0]


def _lamps(brightness: Array, classes: Array, visible: NDArray[np.bool_], count: int) -> Array:
    """Return the smooth part (nz, nx) of log brightness, a polynomial common to all classes."""
    rows, columns = np.indices(visible.shape)
    u, v = columns / visible.shape[1] - 0.5, rows / visible.shape[0] - 0.5
    powers = [(i, j) for i in range(5) for j in range(5) if 0 < i + j <= _LAMP_DEGREE]
    smooth = np.stack([u**i * v**j for i, j in powers], axis=-1)
    members = classes[visible][:, None] == np.arange(count)
    design = np.column_stack([members, smooth[visible]])
    found = np.linalg.lstsq(design, brightness[visible], rcond=None)[0]
    return smooth @ found[count:]


def _masked_median(plane: Array, visible: NDArray[np.bool_]) -> Array:
    """Return the local median, which keeps interfaces sharp; hidden cells are filled first."""
    filled: Array = np.where(visible, plane, np.median(plane[visible])).astype(np.float32)
    for _ in range(2):
        filled = cv2.medianBlur(filled, 5)
    return filled


def _merged(values: Array, classes: Array) -> Array:
    """Return the classes (n,) with overlapping ones merged, numbered by decreasing size."""
    parent = list(range(SANDS.most_sands))
    while True:
        ids = sorted(set(parent))
        spread = {i: values[np.isin(classes, _members(parent, i))].std(axis=0) for i in ids}
        middle = {i: np.median(values[np.isin(classes, _members(parent, i))], axis=0) for i in ids}
        distance = {
            (a, b): float(
                np.linalg.norm(
                    (middle[a] - middle[b])
                    / np.maximum(0.5 * (spread[a] + spread[b]), SANDS.least_spread)
                )
            )
            for a, b in combinations(ids, 2)
        }
        if not distance:
            break
        (a, b), nearest = min(distance.items(), key=lambda item: item[1])
        if nearest >= SANDS.separation:
            break
        parent = [a if p == b else p for p in parent]
    sizes = {i: np.isin(classes, _members(parent, i)).sum() for i in set(parent)}
    order = {i: rank for rank, i in enumerate(sorted(sizes, key=lambda i: -sizes[i]))}
    return np.array([order[parent[c]] for c in classes], dtype=np.uint8)


def _members(parent: list[int], root: int) -> list[int]:
    """Return the original classes that were merged into `root`."""
    return [i for i, p in enumerate(parent) if p == root]


def _tidy(labels: Labels, visible: NDArray[np.bool_]) -> Labels:
    """Return the labels with small patches and hidden cells merged into the surrounding sand."""
    keep = np.zeros(labels.shape, bool)
    least = max(4, int(LARGE_SHARE * labels.size))
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


def _sharpened(labels: Labels, colours: Array, visible: NDArray[np.bool_]) -> Labels:
    """Return the labels with interfaces moved to the edges of brightness.

    Texture locates an interface only to within its window. A watershed grows the sands from their
    certain parts; they meet at the strongest edge.
    """
    if labels.max() == 0:
        return labels
    kernel = np.ones((2 * SANDS.reach_cells + 1,) * 2, np.uint8)
    near = (cv2.dilate(labels, kernel) != cv2.erode(labels, kernel)) & visible
    markers = np.where(near, 0, labels.astype(np.int32) + 1)
    logs = cv2.medianBlur(np.log(np.maximum(colours, LEAST_LIGHT)).astype(np.float32), 3)
    low, high = np.percentile(logs[visible], [1, 99], axis=0)
    picture = np.clip((logs - low) / np.maximum(high - low, 1e-3) * 255, 0, 255).astype(np.uint8)
    grown = cv2.watershed(picture, np.ascontiguousarray(markers, np.int32)) - 1
    unknown = grown < 0
    grown[unknown] = labels[unknown]
    return np.asarray(cv2.medianBlur(grown.astype(np.uint8), 3), np.uint8)


def _without_lamps(labels: Labels, logs: Array, rough: Array, visible: NDArray[np.bool_]) -> Labels:
    """Return the labels with sands merged that only the light of the lamps tells apart.

    Light fades smoothly. Where two sands meet, colours extrapolated from both sides jump, or the
    texture differs.

    Args:
        labels: index of the sand in each cell, shape (nz, nx).
        logs: log colours of the baseline, shape (nz, nx, 3).
        rough: log texture of the baseline, shape (nz, nx).
        visible: cells that show sand, shape (nz, nx).
    """
    planes = [
        _masked_median(np.asarray(p, np.float32), visible)
        for p in (*np.moveaxis(logs, 2, 0), rough)
    ]
    features = np.stack(planes, axis=-1)
    jumps: dict[tuple[int, int], list[Array]] = {}
    for turned in (False, True):
        sides = (labels, features, visible)
        if turned:
            sides = (labels.T, features.transpose(1, 0, 2), visible.T)
        for pair, jump in _interface_jumps(*sides):
            jumps.setdefault(pair, []).append(jump)
    merged = labels.copy()
    for (first, second), found in sorted(jumps.items()):
        jump = np.concatenate(found)
        if len(jump) < SANDS.pairs_together:
            continue
        middle = np.abs(np.median(jump, axis=0))
        if middle[:-1].max() < SANDS.least_spread and middle[-1] < SANDS.lamp_texture:
            merged[merged == merged[labels == second][0]] = merged[labels == first][0]
    return merged


def _interface_jumps(
    labels: Labels, features: Array, visible: NDArray[np.bool_]
) -> list[tuple[tuple[int, int], Array]]:
    """Return pairs of sands that meet along rows, with the jumps between them, shape (n, 4).

    Features are extrapolated to the interface from two cells on each side; the last one, texture,
    is averaged over a window and is only compared. Cells beside the interface mix both sands.
    """
    near, far = _JUMP_CELLS
    wide = labels.shape[1]
    column = np.arange(far, wide - far - 1)
    if not len(column):
        return []
    cells = {'a': column - near, 'aa': column - far, 'b': column + 1 + near, 'bb': column + 1 + far}
    shown = {name: labels[:, where] for name, where in cells.items()}
    seen = np.logical_and.reduce([visible[:, where] for where in cells.values()])
    left, right = labels[:, column], labels[:, column + 1]
    meet = seen & (left != right) & (shown['a'] == left) & (shown['aa'] == left)
    meet &= (shown['b'] == right) & (shown['bb'] == right)
    share = (near + 0.5) / (far - near)
    value = {name: features[:, where][meet] for name, where in cells.items()}
    ends = [
        value[one] + share * (value[one] - value[two]) for one, two in (('a', 'aa'), ('b', 'bb'))
    ]
    jump = ends[1] - ends[0]
    jump[:, -1] = value['bb'][:, -1] - value['aa'][:, -1]
    low, high = np.minimum(left, right)[meet], np.maximum(left, right)[meet]
    jump[left[meet] > right[meet]] *= -1.0
    return [
        ((int(one), int(two)), jump[(low == one) & (high == two)])
        for one, two in np.unique(np.stack([low, high], axis=1), axis=0)
    ]


def fit_factors(
    signals: list[Array],
    labels: Labels,
    levels: Mapping[int, SandLevel],
    strong: float,
    lights: Array,
    same: Sequence[tuple[int, int]] = (),
) -> SandFactors:
    """Return the factors that make the signal of the same tracer the same in all sands.

    Four kinds of evidence meet in one least squares fit of the log signals of stock. The core of a
    plume shows the signal of stock in its sand. At interfaces the signal is continuous: a pair is
    two cells on either side, extrapolated to the interface, so that a slope of concentration is no
    jump. One sand in two places has nearly one factor. A prior from their light keeps all sands
    plausible (`expected_logs`). The reference sand, with the factor 1, has the largest core.

    Args:
        signals: signal of each photograph, shape (nz, nx), NaN where it is not visible.
        labels: index of the sand in each cell, shape (nz, nx).
        levels: signal of stock by sand, where a core shows it.
        strong: strong signal of all photographs [-]; far paler pairs are not used.
        lights: log of the light of each sand (`sand_lights`), shape (sands,).
        same: pairs that are one sand by the description of the rig (`described_sands`).
    """
    count = int(labels.max()) + 1
    first, second, jump = _jumps(signals, labels, STRONG_SHARE * strong)
    pairs = np.bincount(np.concatenate([first, second]), minlength=count)
    reference = _reference(levels, pairs)
    expected = expected_logs(lights, reference)
    logs, deviations = _joint_fit(expected, reference, levels, (first, second, jump), same)
    bound = np.log(SANDS.widest_factor)
    inside = np.clip(logs, -bound, bound)
    sources = [_source(n, levels, pairs, same) for n in range(count)]
    after = jump - inside[first] + inside[second]
    return SandFactors(
        tuple(float(value) for value in np.exp(-inside)),
        tuple(float(value) for value in deviations),
        tuple(int(n) for n in pairs),
        tuple(sources),
        tuple(bool(value) for value in np.abs(logs) > bound),
        reference,
        float(np.median(np.abs(jump))) if len(jump) else 0.0,
        float(np.median(np.abs(after))) if len(jump) else 0.0,
    )


def sand_lights(colours: Array, labels: Labels, visible: NDArray[np.bool_]) -> Array:
    """Return the log light of each sand in the baseline, without the lamps, shape (sands,).

    Args:
        colours: linear colours of the baseline, shape (nz, nx, 3).
        labels: index of the sand in each cell, shape (nz, nx).
        visible: cells that show sand, shape (nz, nx).
    """
    brightness = np.log(np.maximum(colours.mean(axis=2), LEAST_LIGHT))
    even = brightness - _lamps(brightness, labels, visible, int(labels.max()) + 1)
    return np.array(
        [
            np.median(even[visible & (labels == sand)]) if (visible & (labels == sand)).any() else 0
            for sand in range(int(labels.max()) + 1)
        ]
    )


def expected_logs(lights: Array, reference: int) -> Array:
    """Return the log signals of stock that the light of the sands tells, relative to the reference.

    The law of Kubelka and Munk gives the reflection R of a layer with absorption K and scattering S
    by K / S = (1 - R)^2 / (2 R). Fine sand scatters more: it is brighter, and the same dye darkens
    it less. Sand darker than half grey hardly follows.

    Args:
        lights: log of the light of each sand, shape (sands,).
        reference: index of the reference sand.
    """
    return -SANDS.bright_slope * np.maximum(lights - lights[reference], 0.0)


def _source(
    sand: int,
    levels: Mapping[int, SandLevel],
    pairs: Array,
    same: Sequence[tuple[int, int]],
) -> FactorSource:
    """Return the strongest evidence of the factor of a sand."""
    if sand in levels:
        return 'core'
    if any(a in levels or b in levels for a, b in same if sand in (a, b)):
        return 'same sand'
    return 'interface' if pairs[sand] >= SANDS.pairs_together else 'prior'


def _reference(levels: Mapping[int, SandLevel], pairs: Array) -> int:
    """Return the sand with the largest core, or without cores the one with most pairs."""
    if levels:
        return max(levels, key=lambda n: levels[n].cells)
    return int(np.argmax(pairs))


def _joint_fit(
    expected: Array,
    reference: int,
    levels: Mapping[int, SandLevel],
    found: tuple[Array, Array, Array],
    same: Sequence[tuple[int, int]],
) -> tuple[Array, Array]:
    """Return the log signals of stock relative to the reference and their deviations.

    `expected`: log signals before any evidence, shape (sands,).
    """
    rows, values, count = [], [], len(expected)

    def add(a: int, b: int | None, value: float, deviation: float) -> None:
        row = np.zeros(count)
        row[a] = 1.0
        if b is not None:
            row[b] = -1.0
        rows.append(row / deviation)
        values.append(value / deviation)

    unit = levels[reference].level if levels else 1.0
    for sand in range(count):
        relative_to = reference if sand != reference else None
        add(sand, relative_to, float(expected[sand]), SANDS.prior_deviation)
    for sand, one in levels.items():
        add(sand, None, float(np.log(one.level / unit)), one.deviation)
    for a, b in same:
        if a in levels or b in levels:  # two guesses do not confirm each other
            add(a, b, 0.0, SANDS.jump_error)
    first, second, jump = found
    for a, b in combinations(range(count), 2):
        one_way, other_way = (first == a) & (second == b), (first == b) & (second == a)
        jumps = np.concatenate([jump[one_way], -jump[other_way]])
        if len(jumps) < SANDS.pairs_together:
            continue
        middle = float(np.median(jumps))
        spread = SPREAD_PER_DEVIATION * float(np.median(np.abs(jumps - middle)))
        independent = len(jumps) / SANDS.pairs_together
        add(a, b, middle, float(np.hypot(SANDS.jump_error, spread / np.sqrt(independent))))
    design = np.array(rows)
    normal = design.T @ design
    logs = np.linalg.solve(normal, design.T @ np.array(values))
    logs = logs - logs[reference]
    return logs, _relative_deviations(np.linalg.inv(normal), reference)


def _relative_deviations(covariance: Array, reference: int) -> Array:
    """Return the standard deviations of the log signals relative to the reference sand."""
    variance = np.diag(covariance)
    relative = variance + variance[reference] - 2 * covariance[:, reference]
    return np.sqrt(np.maximum(relative, 0.0))


def _jumps(signals: list[Array], labels: Labels, least: float) -> tuple[Array, Array, Array]:
    """Return (first sand, second sand, ln s_first - ln s_second) of every pair of cells.

    A pair is two and four cells away from the interface on each side, so that no cell contains both
    sands. `least`: smallest signal that counts.
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
            strong = np.minimum(a, a_far) > least
            strong &= np.minimum(b, b_far) > least
            chosen = crossing & strong  # comparisons with NaN are False
            logs = [np.log(plane[chosen]) for plane in (a, a_far, b, b_far)]
            found.append((low[chosen], high[chosen], 2 * logs[0] - logs[1] - 2 * logs[2] + logs[3]))
    first, second, jump = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return first.astype(int), second.astype(int), jump


def _shifted(plane: Array, axis: int, start: int, end: int) -> Array:
    """Return `plane` without its first `start` and last `end` rows or columns along `axis`."""
    stop = plane.shape[axis] - end
    return plane[start:stop] if axis == 0 else plane[:, start:stop]
