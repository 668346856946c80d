"""The time of a map of phases within a series of maps of the same run, or of one like it."""

from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.phases.phase_colours import UNKNOWN, WATER

Phases = NDArray[np.uint8]


class SeriesMatch(NamedTuple):
    """The map of a series that overlaps best with another map: its time [s], and the overlap."""

    time_s: float
    overlap: float


def phase_overlap(first: Phases, second: Phases) -> float:
    """Return the cells that have the same CO2 phase in both maps, relative to CO2 in either.

    Cells without a phase do not count. Two maps of water overlap by 1.
    """
    known = (first != UNKNOWN) & (second != UNKNOWN)
    either = ((first != WATER) | (second != WATER)) & known
    if not either.any():
        return 1.0
    return float((first == second)[either].mean())


def series_match(found: Phases, series: Mapping[float, Phases]) -> SeriesMatch:
    """Return the map of a series that overlaps best with the map `found` (nz, nx).

    Args:
        found: phases of one photograph, row 0 at the bottom.
        series: maps of the same rig by time [s], at least one; their cells may have another size.
    """
    nz, nx = found.shape
    overlaps = {
        time: phase_overlap(found, cv2.resize(one, (nx, nz), interpolation=cv2.INTER_NEAREST))
        for time, one in series.items()
    }
    best = max(overlaps, key=overlaps.__getitem__)
    return SeriesMatch(best, overlaps[best])
