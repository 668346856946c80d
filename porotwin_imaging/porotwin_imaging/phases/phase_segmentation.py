"""Maps of phases: water, dissolved CO2 or gas in every cell, and how probable that is.

A colour of a phase costs a cell half of the squared distance from its own change, in units of the
scatter that all colours share (`phase_colours.py`). So the border between two phases lies half-way
between their colours. Neighbouring cells mostly have the same phase: a Potts model adds a cost b
for neighbours with another phase. Its probabilities q are found by the mean-field iteration (Koller
and Friedman, Probabilistic Graphical Models, 2009, sec. 11.5)

    q_p ~ exp(-E_p + b mean_neighbours q_p(neighbour)).

A cell has the phase of the largest q, and this q is its probability.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS
from porotwin_imaging.phases.colour_change import ColourChange
from porotwin_imaging.phases.phase_colours import PHASE, PHASES, UNKNOWN, PhaseColours

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.float32)
_IN_DOUBT = 0.5
"""Highest confidence of bright cells without grains: gas and bright objects look alike."""


@dataclass(frozen=True)
class PhaseMap:
    """The phases in one photograph.

    Attributes:
        phase: number of the phase of each cell, uint8, shape (nz, nx), row 0 at the bottom,
            `UNKNOWN` where the photograph does not show the sand.
        confidence: probability of this phase [-], same shape, NaN where it is unknown.
        reason: why a cell has no phase, index of `colour_change.REASONS`, same shape.
        remarks: one line each.
    """

    phase: NDArray[np.uint8]
    confidence: NDArray[np.float32]
    reason: NDArray[np.uint8]
    remarks: list[str]


def segment_phases(change: ColourChange, colours: PhaseColours, water: Mask) -> PhaseMap:
    """Return the phases in one photograph.

    Args:
        change: the change of colour since the baseline.
        colours: the colours of the phases.
        water: cells that always show water, shape (nz, nx).
    """
    of_colour = probabilities(change, colours, water)
    of_phase = np.zeros((len(PHASES), *water.shape), np.float32)
    np.add.at(of_phase, colours.phase, of_colour)
    phase = np.where(change.visible, of_phase.argmax(axis=0), UNKNOWN).astype(np.uint8)
    confidence = np.where(change.visible, of_phase.max(axis=0), np.nan).astype(np.float32)
    confidence[change.doubtful] = np.minimum(confidence[change.doubtful], _IN_DOUBT)
    return PhaseMap(phase, confidence, change.reason, change.remarks)


def probabilities(change: ColourChange, colours: PhaseColours, water: Mask) -> NDArray[np.float32]:
    """Return the probability of each colour in each cell, (n, nz, nx); 0 in cells not seen."""
    costs = colours.costs(change)
    costs[1:, water] = np.inf
    data = -(costs - costs.min(axis=0))
    seen = change.visible.astype(np.float32)
    weight = np.maximum(_around(seen), 1.0)
    q = _softmax(data) * seen
    for _ in range(FEW_ROUNDS):
        q = _softmax(data + PHASE.coupling * np.stack([_around(one) for one in q]) / weight) * seen
    return q


def _around(plane: Array) -> Array:
    """Return the sum over the eight neighbours of each cell."""
    return cv2.filter2D(plane, -1, _NEIGHBOURS, borderType=cv2.BORDER_CONSTANT)


def _softmax(values: Array) -> NDArray[np.float32]:
    """Return exp(values) (n, nz, nx) divided by its sum over the first axis."""
    powers = np.exp(values - values.max(axis=0))
    return np.asarray(powers / powers.sum(axis=0), np.float32)
