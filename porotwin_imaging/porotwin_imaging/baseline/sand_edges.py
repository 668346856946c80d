"""The edges of the sand in the baseline against the edges that rig.yaml describes.

A lens or a bulging plate bends the edges of the sand. The description follows them by the terms of
curvature. If these are missing, the dark frame reaches into the described rig in the middle of a
side and not at its corners.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.baseline.edge_search import PARTS

Array = NDArray[Any]

_DEEPEST = 0.1
"""A frame is searched down to this share of the rig; a deeper one is a shadow [-]."""


@dataclass(frozen=True)
class EdgeEvidence:
    """One edge of the sand.

    Attributes:
        side: 'upper', 'lower', 'left' or 'right'.
        bow: depth of the frame in the middle of the side minus that at its ends, relative to the
            size of the rig across the side [-].
    """

    side: str
    bow: float


def sand_edges(unlit: NDArray[np.bool_]) -> tuple[EdgeEvidence, ...]:
    """Return the bow of each side that shows the dark frame.

    Args:
        unlit: True for frame and deep shadow, on the sampling grid of the described rig, shape
            (rows, columns), row 0 at the top.
    """
    sides = {'upper': unlit, 'lower': unlit[::-1], 'left': unlit.T, 'right': unlit.T[::-1]}
    found = {side: _bow(seen) for side, seen in sides.items()}
    return tuple(EdgeEvidence(side, bow) for side, bow in found.items() if np.isfinite(bow))


def _bow(unlit: NDArray[np.bool_]) -> float:
    """Return the bow of the frame along the first row; NaN if no frame is seen there."""
    reach = max(2, int(_DEEPEST * unlit.shape[0]))
    depth = unlit[:reach].sum(axis=0) / unlit.shape[0]
    parts = np.array([np.median(part) for part in np.array_split(depth, PARTS)])
    if parts[1:-1].max() >= reach / unlit.shape[0]:
        return np.nan
    inner = slice(1, -1)  # the outer parts see the frame of the neighbouring side
    bend, _, _ = np.polyfit(np.linspace(-1, 1, PARTS)[inner], parts[inner], 2)
    return float(-bend)
