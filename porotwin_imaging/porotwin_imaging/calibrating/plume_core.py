"""The core of a plume: the cells far enough from its front to hold the injected tracer.

Behind a front the signal rises to a plateau. The depth of a cell is its distance from the edge of
the plume. The core begins at the depth where the plateau is reached. A plume without a plateau,
because it is small or has spread widely, has no core.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS


@dataclass(frozen=True)
class CoreSettings:
    """Finding the core of a plume (`plume_core.py`)."""

    plateau_share: float = 0.88
    """Cells of the core exceed this share of its top [-]. Paler plumes beside it are no core."""
    least_share: float = 0.3
    """Share of the plume that its core has at least [-]: the level of few cells is uncertain."""
    reached: float = 0.99
    """The plateau begins at this share of the highest level [-]."""
    flattest: float = 0.025
    """Largest rise inside a core [-]; a plume that rises further has no plateau."""
    level_error: float = 0.007
    """Relative standard deviation of the level of a core [-]: light, and stock that is not quite
    reached."""
    outlier: float = 0.04
    """Photographs whose core differs from the others by more disagree with them [-], as do those
    whose mass is as far from the common line, relative to the largest injected mass."""
    interface_cells: int = 2
    """Cells this near to another sand belong to no core: pixels and labels mix there."""


CORE = CoreSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_OPENING = np.ones((3, 3), np.uint8)
"""Smaller specks are no plume."""
_SMOOTH = (3, 3)
"""Cells whose mean decides about the level of a cell: grains are uneven."""
_TOP_PERCENTILE = 90.0
"""Percentile of the strong and of the deep cells that counts as their top."""
STRONG_SHARE = 0.3
"""Cells above this share of the largest signal are strong, and the edge of a plume lies at this
share of the strong signal [-]. Stock in fine sand gives about half the signal of that in coarse
sand. Paler tracer at an interface has often not entered the finer sand."""


@dataclass(frozen=True)
class Core:
    """The core of the plumes of one photograph.

    Attributes:
        cells: cells of the core, shape (nz, nx).
        level: median signal of the core [-].
        flatness: relative difference of the signal between the deeper and the shallower half of
            the core [-]; 0 for a plateau.
        depth: smallest depth of its cells [cells].
    """

    cells: Mask
    level: float
    flatness: float
    depth: int


def strong_signal(signals: Sequence[Array]) -> float:
    """Return the strong signal [-] of several photographs, each (nz, nx), NaN where hidden.

    It is 0 if no photograph is darker than the baseline anywhere.
    """
    smooth = [cv2.blur(np.nan_to_num(plane).astype(np.float32), _SMOOTH) for plane in signals]
    top = max(float(plane.max()) for plane in smooth)
    if top <= 0:
        return 0.0
    strong = np.concatenate([plane[plane > STRONG_SHARE * top] for plane in smooth])
    return float(np.percentile(strong, _TOP_PERCENTILE))


def plume_depth(signal: Array, strong: float) -> Array:
    """Return the depth [cells] inside the plumes of `signal`, shape (nz, nx), 0 outside.

    Hidden cells are outside. `strong`: the strong signal of the photographs.
    """
    plume = np.nan_to_num(signal) > STRONG_SHARE * strong
    opened = cv2.morphologyEx(plume.astype(np.uint8), cv2.MORPH_OPEN, _OPENING)
    return np.asarray(cv2.distanceTransform(opened, cv2.DIST_L2, 5))


def find_core(signal: Array, depth: Array) -> Core | None:
    """Return the core of the strongest plume, or None without one.

    Args:
        signal: signal times sand factor [-], shape (nz, nx), NaN where it is hidden.
        depth: depth in the plume [cells], same shape, 0 where cells do not count.
    """
    filled = np.nan_to_num(signal).astype(np.float32)
    smooth = cv2.blur(filled, _SMOOTH)
    levels: list[tuple[int, Mask, float]] = []
    for least in range(1, int(depth.max()) + 1):
        deep = (depth >= least) & np.isfinite(signal)
        if deep.sum() < FEWEST_CELLS:
            break
        top = float(np.percentile(smooth[deep], _TOP_PERCENTILE))
        cells = deep & (smooth > CORE.plateau_share * top)
        if cells.sum() < FEWEST_CELLS:
            break
        levels.append((least, cells, float(np.median(filled[cells]))))
    if not levels:
        return None
    most = levels[0][1].sum()
    broad = [one for one in levels if one[1].sum() >= CORE.least_share * most]
    highest = max(level for _, _, level in broad)
    # one cell deeper than the first depth on the plateau, if there are enough cells
    first = next(n for n, (_, _, level) in enumerate(broad) if level > CORE.reached * highest)
    least, cells, level = broad[min(first + 1, len(broad) - 1)]
    return Core(cells, level, _flatness(filled, depth, cells, level), least)


def _flatness(signal: Array, depth: Array, cells: Mask, level: float) -> float:
    """Return the relative rise of the signal from the shallower to the deeper half of the core."""
    middle = float(np.median(depth[cells]))
    deeper, shallower = cells & (depth > middle), cells & (depth <= middle)
    if not deeper.any() or not shallower.any():
        return 0.0
    rise = float(np.median(signal[deeper]) - np.median(signal[shallower]))
    return rise / level
