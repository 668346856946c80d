"""The sands of the rig as it is described, where a picture alone does not tell them.

Two sands may look alike and absorb differently, and lamps make one sand look like two. The map of
permeability in rig.yaml knows both. Its edges are not those of the photograph, so that only thick
parts of a sand count, and the picture draws the edges.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.sand_interfaces import MOST_SANDS, sand_level
from porotwin_imaging.calibrating.sands import SANDS
from porotwin_imaging.geometry.frame import LARGE_SHARE

Array = NDArray[Any]
Labels = NDArray[np.uint8]


@dataclass(frozen=True)
class SandParts:
    """Sands that differ in look or in description.

    Attributes:
        labels: index of the part in each cell, shape (nz, nx), 0 to the number of parts - 1.
        same: pairs of parts that are the same sand by the description.
    """

    labels: Labels
    same: tuple[tuple[int, int], ...] = ()


def described_kinds(rig: Rig, grid: Grid) -> Labels | None:
    """Return the number of the described sand of each cell, shape (nz, nx).

    None: the description has one permeability, or a field that varies everywhere.
    """
    logs = sand_level(rig.nominal_map('permeability_m2'))
    levels, index = np.unique(logs, return_inverse=True)
    if not 1 < len(levels) <= MOST_SANDS:
        return None
    kinds = index.reshape(logs.shape).astype(np.uint8)
    return np.asarray(
        cv2.resize(kinds, grid.shape[::-1], interpolation=cv2.INTER_NEAREST), np.uint8
    )


def sand_names(rig: Rig, grid: Grid, labels: Labels) -> tuple[str, ...]:
    """Return the names of the sands in rig.yaml, by label.

    A label has the name of the sand that fills most of its cells. Sands of the same permeability
    are joined by "or". A name is empty if rig.yaml names no such sand.

    Args:
        rig: the rig.
        grid: the grid of the labels.
        labels: index of the sand in each cell, shape (nz, nx).
    """
    logs = sand_level(rig.nominal_map('permeability_m2'))
    told = cv2.resize(logs, grid.shape[::-1], interpolation=cv2.INTER_NEAREST)
    named = {name: sand_level(rig.permeability_of_sand(name)).item() for name in rig.sands}
    names = []
    for label in range(int(labels.max()) + 1):
        levels, counts = np.unique(told[labels == label], return_counts=True)
        most = levels[counts.argmax()] if len(levels) else None
        names.append(' or '.join(name for name, level in named.items() if level == most))
    return tuple(names)


def described_parts(looks: Labels, kinds: Labels | None) -> SandParts:
    """Return the sands of the picture, each divided where the description knows several sands.

    Args:
        looks: index of the sand in each cell by its look (`sands.segment`), shape (nz, nx).
        kinds: index of the described sand in each cell, same shape; None: nothing is known.
    """
    if kinds is None:
        return SandParts(looks)
    labels = np.zeros_like(looks)
    known: list[int] = []
    for look in range(int(looks.max()) + 1):
        inside = looks == look
        thick = _thick_parts(inside, kinds)
        names = [int(kind) for kind in np.unique(kinds[thick])]
        if not names:  # the description does not fit the picture
            thick, names = (
                inside,
                [int(np.bincount(kinds[inside]).argmax())] if inside.any() else [],
            )
            labels[inside] = len(known)
        else:
            own = np.where(np.isin(kinds, names), kinds, _nearest(kinds, thick))
            part = np.searchsorted(names, own)
            labels[inside] = (len(known) + part)[inside]
        known += names
    pairs = combinations(range(len(known)), 2)
    return SandParts(labels, tuple((a, b) for a, b in pairs if known[a] == known[b]))


def _thick_parts(inside: NDArray[np.bool_], kinds: Labels) -> Array:
    """Return the cells of a look in large and thick parts of one described sand, (nz, nx)."""
    kernel = np.ones((2 * SANDS.reach_cells + 1,) * 2, np.uint8)
    thick = np.zeros(inside.shape, bool)
    for kind in np.unique(kinds[inside]):
        part = (inside & (kinds == kind)).astype(np.uint8)
        core = cv2.morphologyEx(part, cv2.MORPH_OPEN, kernel) > 0
        if core.sum() >= LARGE_SHARE * inside.size:
            thick |= core
    return thick


def _nearest(kinds: Labels, chosen: NDArray[np.bool_]) -> Labels:
    """Return the kind of the nearest chosen cell, shape (nz, nx)."""
    _, nearest = cv2.distanceTransformWithLabels(
        (~chosen).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(nearest.max() + 1, np.uint8)
    source[nearest[chosen]] = kinds[chosen]
    return source[nearest]
