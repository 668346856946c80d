"""The colours of water, dissolved CO2 and gas: how each phase changes the baseline, sand by sand.

Water with a pH indicator fills the pores of the baseline. CO2 that dissolves changes the colour of
the indicator. Gas drives the water away: the colour of the indicator is gone, and dry sand is
brighter. A change of colour is a log ratio to the baseline, without the colour of the sand and the
lamps. Its size still depends on the sand, so that each sand has colours of its own.

The colours come from boxes that a person gives, or from clusters of all changed cells. The
brightest cluster is gas if all its channels are brighter than water; the others are dissolved CO2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.phases.colour_change import Box, ColourChange


@dataclass(frozen=True)
class PhaseSettings:
    """Maps of water, dissolved CO2 and gas (`phase_colours.py`, `phase_segmentation.py`)."""

    least_change: float = 0.08
    """Smaller changes of colour are water [log]: light and grains cause up to 0.05."""
    most_uneven: float = 0.6
    """Range of a colour around a cell, relative to it, above which the cell lies at an edge [-]."""
    least_share: float = 0.002
    """Changed cells, relative to the sand of a photograph, that show the colour of a phase [-]."""
    apart: float = 0.45
    """Difference of two colours, relative to the stronger one, below which they are one [-]."""
    least_cluster: float = 0.02
    """Share of the changed cells below which a cluster joins the nearest one [-]."""
    least_gas: float = 0.05
    """Brightening of every channel in gas [log]: dry sand without indicator."""
    same_hue: float = 0.96
    """Cosine between two changes of colour from which they have one hue [-]."""
    cells_for_sand: float = 40.0
    """Cells that give a sand colours of its own; fewer are drawn to the colours of all sands."""
    least_spread: float = 0.04
    """Standard deviation of the colour of a cell that is added to its scatter [log]."""
    most_samples: int = 60_000
    """Most cells that are used to find colours; more tell nothing more."""
    sharpness: float = 0.5
    """Factor on the costs of colours, which are not independent from cell to cell [-]."""
    coupling: float = 4.0
    """Gain in log probability if all neighbours have the same phase [-]."""
    doubt: float = 0.5
    """Exponent of the probabilities: the model knows nothing of blur and place at edges [-]. Fitted
    to rendered photographs."""
    foreign: float = 0.25
    """Distance from all colours and their mixtures that no phase explains [log]."""
    foreign_share: float = 0.4
    """The same relative to the change of colour [-]."""
    told_foreign: float = 0.001
    """Share of the sand with the colour of no phase that is told [-]."""


PHASE = PhaseSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

PHASES = ('water', 'dissolved', 'gas')
"""Names of the phases; their numbers in maps are the indices."""
WATER, DISSOLVED, GAS = range(3)
UNKNOWN = 255
"""Number of cells without a phase."""
CHANNELS = ('red', 'green', 'blue')

_CLUSTERING_SEED = 7
_CLUSTERING_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
_CLUSTERING_TRIALS = 3
_CLUSTERS = 8
"""Clusters that are searched, more than there are colours; then similar ones are merged."""
_WINDOW = 3
"""Cells across the window that averages a colour and tells whether it is even."""
_READILY = 0.1
"""Factor on the difference of clusters that are small or of one hue: they merge first [-]."""
_FULL_PERCENTILE, _FULL_SHARE = 90.0, 0.6
"""Cells with at least this share of the colour at the percentile show it in full [-]."""
_SMALLEST_DIVISOR = 1e-6
_DARKER = 0.05
"""Change of a channel that is darker beyond the drift of the lamps [log]."""


@dataclass(frozen=True)
class PhaseColours:
    """The colours of all phases; a phase may have several. The first one is water, without change.

    Attributes:
        phase: number of the phase of each colour, shape (n,).
        change: log ratio to the baseline in each sand, shape (sands, n, 3 = red, green, blue).
        spread: covariance of the colour of a cell in each sand, shape (sands, 3, 3).
    """

    phase: NDArray[np.int64]
    change: Array
    spread: Array

    @property
    def phases(self) -> tuple[int, ...]:
        """The phases that have a colour, in ascending order."""
        return tuple(int(number) for number in np.unique(self.phase))

    def darken_only(self) -> bool:
        """Return whether all colours are darker than water in every channel, as those of a dye."""
        change = np.median(self.change, axis=0)[1:]
        return bool(len(change) and (change < -_DARKER).all())

    def words(self) -> list[str]:
        """Return each colour but water in words, as its median over the sands."""
        lines = []
        for number, change in zip(self.phase[1:], np.median(self.change, axis=0)[1:], strict=True):
            parts = (
                f'{name} {100 * value:+.0f} %'
                for name, value in zip(CHANNELS, np.expm1(change), strict=True)
            )
            lines.append(f'{PHASES[number]}: {", ".join(parts)} against water')
        return lines


class _Samples(NamedTuple):
    """Changed cells of all photographs: colour (n, 3), sand (n,) and colour number (n,)."""

    change: Array
    sand: NDArray[np.uint8]
    number: NDArray[np.int64]


def given_colours(
    changes: Mapping[float, ColourChange],
    boxes: Mapping[int, Sequence[Box]],
    sands: NDArray[np.uint8],
    grid: Any,
) -> PhaseColours:
    """Return the colours in boxes that a person gives.

    Args:
        changes: photographs by time [s].
        boxes: boxes of each phase; phases without a box are not searched.
        sands: index of the sand in each cell, shape (nz, nx).
        grid: the grid of the maps.

    Raises:
        InputError: a box shows no sand, two phases have one colour, or they are exchanged.
    """
    means: dict[int, Array] = {}
    parts: list[_Samples] = []
    for number, phase in enumerate(sorted(boxes), 1):
        found = [_in_box(box, phase, changes, sands, grid) for box in boxes[phase]]
        change, sand = (np.concatenate(side) for side in zip(*found, strict=True))
        means[phase] = np.median(change, axis=0)
        parts.append(_Samples(change, sand, np.full(len(change), number)))
    _refuse_alike(means, boxes)
    samples = _Samples(*(np.concatenate(side) for side in zip(*parts, strict=True)))
    of_colour = np.array([WATER, *sorted(boxes)])
    return _fitted(samples, of_colour, int(sands.max()) + 1)


def _in_box(
    box: Box, phase: int, changes: Mapping[float, ColourChange], sands: Array, grid: Any
) -> tuple[Array, Array]:
    """Return the changes (n, 3) of the cells in a box, and their sands (n,)."""
    times = np.array(list(changes))
    time = times[-1] if box.time is None else times[np.abs(times - box.time).argmin()]
    shown = changes[float(time)]
    inside = box.cells(grid) & shown.visible
    if not inside.any():
        raise InputError(f'{PHASES[phase]} {box}: no visible sand in it; give another box')
    return shown.log_ratio[inside], sands[inside]


def _refuse_alike(means: Mapping[int, Array], boxes: Mapping[int, Sequence[Box]]) -> None:
    """Raise InputError if two phases have one colour, or if gas and dissolved are exchanged."""
    for phase, mean in means.items():
        if np.abs(mean).max() < PHASE.least_change:
            raise InputError(
                f'{PHASES[phase]} {boxes[phase][0]}: its colour differs from the baseline by '
                f'{100 * float(np.abs(mean).max()):.0f} %, which is water; give a box that shows '
                f'{PHASES[phase]}, and the time of its photograph after an @'
            )
    if DISSOLVED not in means or GAS not in means:
        return
    dissolved, gas = means[DISSOLVED], means[GAS]
    if np.linalg.norm(gas - dissolved) < PHASE.apart * np.linalg.norm(gas):
        raise InputError(
            f'gas {boxes[GAS][0]} and dissolved {boxes[DISSOLVED][0]} have the same colour; '
            'give boxes that show one phase each'
        )
    if gas.mean() < dissolved.mean() and gas.min() < dissolved.min():
        raise InputError(
            f'gas {boxes[GAS][0]} is darker than dissolved {boxes[DISSOLVED][0]}: gas drives the '
            'coloured water away and leaves bright sand; exchange the two'
        )


def found_colours(
    changes: Sequence[ColourChange],
    sands: NDArray[np.uint8],
) -> PhaseColours:
    """Return the colours of the clusters of all changed cells.

    Args:
        changes: the photographs.
        sands: index of the sand in each cell, shape (nz, nx).

    Raises:
        InputError: nothing has changed its colour.
    """
    picked = [_even_cells(change) for change in changes]
    change, sand = (
        np.concatenate(side)
        for side in zip(*((smooth[even], sands[even]) for smooth, even in picked), strict=True)
    )
    seen = max(1, *(int(one.visible.sum()) for one in changes))
    if len(change) < PHASE.least_share * seen:
        raise InputError(
            f'{len(changes)} photographs: nothing has changed its colour since the baseline by '
            f'more than {100 * PHASE.least_change:.0f} %; the baseline must show the rig before '
            'the injection, with the indicator in its water'
        )
    step = max(1, len(change) // PHASE.most_samples)
    change, sand = change[::step], sand[::step]
    number = _merged(change, _clustered(change))
    means = np.array([np.median(change[number == n], axis=0) for n in range(number.max() + 1)])
    phase = np.array([WATER, *_named(means)])
    return _fitted(_Samples(change, sand, number + 1), phase, int(sands.max()) + 1)


def _even_cells(change: ColourChange) -> tuple[Array, Mask]:
    """Return averages over windows (nz, nx, 3), and the changed cells that lie at no edge."""
    shown = np.where(change.visible[..., None], change.log_ratio, 0.0).astype(np.float32)
    window = (_WINDOW, _WINDOW)
    weight = cv2.blur(change.visible.astype(np.float32), window)
    smooth = cv2.blur(shown, window) / np.maximum(weight, _SMALLEST_DIVISOR)[..., None]
    size = np.linalg.norm(smooth, axis=2)
    around = np.ones((_WINDOW + 2, _WINDOW + 2), np.uint8)
    range_ = np.linalg.norm(cv2.dilate(smooth, around) - cv2.erode(smooth, around), axis=2)
    whole = cv2.erode(change.visible.astype(np.uint8), np.ones(window, np.uint8)) > 0
    even = whole & (size > PHASE.least_change) & (range_ < PHASE.most_uneven * size)
    return smooth, even


def _clustered(change: Array) -> Array:
    """Return the cluster of each change (n,) by k-means."""
    numbers = np.zeros((len(change), 1), np.int32)
    count = min(_CLUSTERS, len(change))
    cv2.setRNGSeed(_CLUSTERING_SEED)
    cv2.kmeans(
        np.ascontiguousarray(change, np.float32), count, numbers, _CLUSTERING_CRITERIA,
        _CLUSTERING_TRIALS, cv2.KMEANS_PP_CENTERS,
    )  # fmt: skip
    return numbers[:, 0]


def _merged(change: Array, number: Array) -> NDArray[np.int64]:
    """Return the clusters (n,) with similar and small ones merged, numbered from 0.

    One colour is strong in one sand and pale in another, or at a wide front. So the difference of
    two clusters counts relative to the stronger one, and not at all if they have the same hue.
    """
    number = number.astype(np.int64)
    while True:
        ids, sizes = np.unique(number, return_counts=True)
        if len(ids) == 1:
            break
        means = np.array([np.median(change[number == one], axis=0) for one in ids])
        size = np.maximum(np.linalg.norm(means, axis=1), _SMALLEST_DIVISOR)
        apart = np.linalg.norm(means[:, None] - means[None], axis=2)
        apart /= np.maximum(size[:, None], size[None])
        unit = means / size[:, None]
        small = sizes < PHASE.least_cluster * len(change)
        apart[(unit @ unit.T > PHASE.same_hue) | small[:, None]] *= _READILY
        np.fill_diagonal(apart, np.inf)
        first, second = np.unravel_index(apart.argmin(), apart.shape)
        if apart[first, second] >= PHASE.apart:
            break
        number[number == ids[first]] = ids[second]
    return np.unique(number, return_inverse=True)[1].astype(np.int64)


def _named(means: Array) -> list[int]:
    """Return the phase of each cluster from its mean change, shape (n, 3)."""
    least = means.min(axis=1)
    gas = int(least.argmax())
    if least[gas] < PHASE.least_gas:
        return [DISSOLVED] * len(means)
    unit = means / np.maximum(np.linalg.norm(means, axis=1), _SMALLEST_DIVISOR)[:, None]
    alike = unit @ unit[gas] > PHASE.same_hue
    return [GAS if alike[n] and least[n] > 0.0 else DISSOLVED for n in range(len(means))]


def refitted(
    colours: PhaseColours,
    changes: Sequence[ColourChange],
    numbers: Sequence[NDArray[np.uint8]],
    sands: NDArray[np.uint8],
) -> PhaseColours:
    """Return the colours of the cells that a first segmentation gave to each of them.

    Args:
        colours: the first colours.
        changes: the photographs.
        numbers: number of the colour of each cell, one map (nz, nx) for each photograph.
        sands: index of the sand in each cell, shape (nz, nx).
    """
    parts = []
    for change, number in zip(changes, numbers, strict=True):
        _, even = _even_cells(change)
        certain = even & (number > 0) & (number < len(colours.phase))
        parts.append((change.log_ratio[certain], sands[certain], number[certain].astype(np.int64)))
    change_of, sand, number_of = (np.concatenate(side) for side in zip(*parts, strict=True))
    step = max(1, len(change_of) // PHASE.most_samples)
    samples = _Samples(change_of[::step], sand[::step], number_of[::step])
    return _fitted(samples, colours.phase, int(sands.max()) + 1, colours)


def _fitted(
    samples: _Samples,
    phase: Array,
    sand_count: int,
    before: PhaseColours | None = None,
) -> PhaseColours:
    """Return the colours of the samples: medians of each sand, drawn to the medians of all.

    A colour without samples stays as it was `before`.
    """
    change = np.zeros((sand_count, len(phase), 3))
    residuals = np.zeros((0, 3))
    for number in range(1, len(phase)):
        of_colour = samples.number == number
        if not of_colour.any():
            assert before is not None  # every first colour has samples
            change[:, number] = before.change[:, number]
            continue
        pooled = np.median(samples.change[of_colour], axis=0)
        for sand in range(sand_count):
            own = _in_full(samples.change[of_colour & (samples.sand == sand)], pooled)
            weight = len(own) / (len(own) + PHASE.cells_for_sand)
            local = np.median(own, axis=0) if len(own) else pooled
            change[sand, number] = weight * local + (1.0 - weight) * pooled
            residuals = np.concatenate([residuals, own - change[sand, number]])
    spread = np.cov(residuals.T) if len(residuals) > len(CHANNELS) else np.zeros((3, 3))
    spread = spread + PHASE.least_spread**2 * np.eye(3)
    return PhaseColours(np.asarray(phase), change, np.repeat(spread[None], sand_count, axis=0))


def _in_full(change: Array, direction: Array) -> Array:
    """Return the changes (n, 3) that show a colour in full along `direction`: no pale fronts."""
    if not len(change):
        return change
    along = change @ direction
    return change[along >= _FULL_SHARE * np.percentile(along, _FULL_PERCENTILE)]
