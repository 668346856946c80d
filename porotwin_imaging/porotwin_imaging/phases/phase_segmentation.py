"""Maps of phases: water, dissolved CO2 or gas in every cell, and how sure that is.

The change of colour x of a cell (`colour_change.py`) has the cost

    E_p = 1/2 (x - m_p)^T C^-1 (x - m_p)

in phase p, with the colour m_p of the phase in the sand of the cell, and one covariance C for all
phases. So the boundary between two phases lies half-way between their colours. Neighbouring cells
mostly have the same phase: a Potts model adds a cost b for every neighbour with another phase. Its
probabilities q are found by the mean-field iteration (Koller and Friedman, Probabilistic Graphical
Models, 2009, sec. 11.5)

    q_p ~ exp(-t E_p + b sum_neighbours w q_p(neighbour)),

where the temperature 1 / t accounts for colours that are no exact Gaussian. A cell has the phase of
the largest q. Its confidence is q^d, with a doubt d below 1 and the sum 1, because neighbours are
less independent than the model has it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.phases.colour_change import ColourChange
from porotwin_imaging.phases.phase_colours import (
    PHASE,
    PHASES,
    UNKNOWN,
    WATER,
    PhaseColours,
    refitted,
)

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_NEIGHBOURS = np.array(
    [[0.5**0.5, 1.0, 0.5**0.5], [1.0, 0.0, 1.0], [0.5**0.5, 1.0, 0.5**0.5]], np.float32
)
"""Weights of the neighbours: the inverse of their distance."""
_ROUNDS = 20
"""Mean-field iterations; labels hardly change after ten."""
_STRONGER = 2.2
"""A colour may be stronger than its median by this factor."""
_SMALLEST_DIVISOR = 1e-6
_IN_DOUBT = 0.5
"""Largest confidence of cells that may show a bright object instead of gas [-]."""
_REFITS = 2
"""Segmentations after which the colours are fitted again."""


@dataclass(frozen=True)
class PhaseMap:
    """The phases in one photograph.

    Attributes:
        phase: number of the phase (index of `PHASES`), uint8, shape (nz, nx), row 0 at the bottom,
            `UNKNOWN` where the photograph does not show the sand or another colour.
        confidence: probability of this phase [-], same shape, NaN where it is unknown.
        remarks: one line each.
    """

    phase: NDArray[np.uint8]
    confidence: NDArray[np.float32]
    remarks: list[str]


def refined_colours(
    colours: PhaseColours,
    changes: Sequence[ColourChange],
    sands: NDArray[np.uint8],
) -> PhaseColours:
    """Return the colours after a few segmentations: each sand then has its own.

    Args:
        colours: first colours, from boxes or clusters.
        changes: the photographs.
        sands: index of the sand in each cell, shape (nz, nx).
    """
    for _ in range(_REFITS):
        numbers = [_colour_numbers(change, colours, sands) for change in changes]
        colours = refitted(colours, changes, numbers, sands)
    return colours


def segment_phases(
    change: ColourChange,
    colours: PhaseColours,
    sands: NDArray[np.uint8],
) -> PhaseMap:
    """Return the phases in one photograph.

    Args:
        change: the change of colour since the baseline.
        colours: the colours of the phases.
        sands: index of the sand in each cell, shape (nz, nx).
    """
    costs = _costs(change, colours, sands)
    known = change.visible & ~_foreign(change, colours, sands)
    of_phase = np.full((len(PHASES), *known.shape), np.inf, np.float32)
    for number, phase in enumerate(colours.phase):
        of_phase[phase] = np.minimum(of_phase[phase], costs[number])
    powers = _mean_field(of_phase, known) ** np.float32(PHASE.doubt)
    probability = powers / np.maximum(powers.sum(axis=0), _SMALLEST_DIVISOR)
    phase = np.where(known, probability.argmax(axis=0), UNKNOWN).astype(np.uint8)
    confidence = np.where(known, probability.max(axis=0), np.nan).astype(np.float32)
    confidence[change.doubtful] = np.minimum(confidence[change.doubtful], _IN_DOUBT)
    return PhaseMap(phase, confidence, change.remarks + _remarks(change, known))


def _remarks(change: ColourChange, known: Mask) -> list[str]:
    """Return a remark if a part of the sand has another colour than all phases."""
    share = float((change.visible & ~known).sum() / max(1, change.visible.sum()))
    if share < PHASE.told_foreign:
        return []
    return [f'{100 * share:.1f} % of the sand has the colour of no phase: left out']


def _costs(change: ColourChange, colours: PhaseColours, sands: Array) -> Array:
    """Return the cost E of each colour in each cell, float32, shape (n, nz, nx)."""
    costs = np.empty((len(colours.phase), *sands.shape), np.float32)
    for sand in np.unique(sands):
        here = sands == sand
        root = np.linalg.cholesky(np.linalg.inv(colours.spread[sand]))
        white = change.log_ratio[here] @ root
        for number, mean in enumerate(colours.change[sand] @ root):
            costs[number][here] = 0.5 * ((white - mean) ** 2).sum(axis=1)
    return costs


def _colour_numbers(change: ColourChange, colours: PhaseColours, sands: Array) -> NDArray[np.uint8]:
    """Return the number of the colour of each cell (nz, nx), `UNKNOWN` where there is none."""
    known = change.visible & ~_foreign(change, colours, sands)
    probability = _mean_field(_costs(change, colours, sands), known)
    return np.where(known, probability.argmax(axis=0), UNKNOWN).astype(np.uint8)


def _foreign(change: ColourChange, colours: PhaseColours, sands: Array) -> Mask:
    """Return the cells (nz, nx) whose colour is neither one of a phase nor between two of them."""
    nearest = np.full(sands.shape, np.inf, np.float32)
    smooth = cv2.blur(np.asarray(change.log_ratio, np.float32), (3, 3))
    for sand in np.unique(sands):
        here = sands == sand
        means = colours.change[sand]
        found = np.full(int(here.sum()), np.inf, np.float32)
        for first, second in combinations(range(len(means)), 2):
            longest = _STRONGER if first == WATER else 1.0
            found = np.minimum(found, _distance(smooth[here], means[first], means[second], longest))
        nearest[here] = found
    size = np.linalg.norm(smooth, axis=2)
    return np.asarray(nearest > np.maximum(PHASE.foreign, PHASE.foreign_share * size))


def _distance(points: Array, start: Array, end: Array, longest: float) -> Array:
    """Return the distance of points (n, 3) from a line of `longest` times the way to `end`."""
    along = (end - start).astype(points.dtype)
    away = points - start.astype(points.dtype)
    share = np.clip(away @ along / max(float(along @ along), 1e-12), 0.0, longest)
    return np.linalg.norm(away - share[:, None] * along, axis=1)


def _mean_field(costs: Array, known: Mask) -> NDArray[np.float32]:
    """Return probabilities (n, nz, nx) from costs of the same shape; 0 where not known."""
    data = -PHASE.sharpness * (costs - costs.min(axis=0))
    seen = known.astype(np.float32)
    weight = np.maximum(cv2.filter2D(seen, -1, _NEIGHBOURS, borderType=cv2.BORDER_CONSTANT), 1.0)
    q = _softmax(data) * seen
    for _ in range(_ROUNDS):
        around = [cv2.filter2D(one, -1, _NEIGHBOURS, borderType=cv2.BORDER_CONSTANT) for one in q]
        q = _softmax(data + PHASE.coupling * (np.stack(around) / weight)) * seen
    return q


def _softmax(values: Array) -> NDArray[np.float32]:
    """Return exp(values) (n, nz, nx) divided by its sum over the first axis."""
    powers = np.exp(values - values.max(axis=0))
    return np.asarray(powers / powers.sum(axis=0), np.float32)
