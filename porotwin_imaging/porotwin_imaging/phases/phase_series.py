"""The time of a map of phases within a series of maps of the same run, or of one like it."""

from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.phases.phase_colours import UNKNOWN, WATER

Phases = NDArray[np.uint8]


class SeriesMatch(NamedTuple):
    """Where a map belongs in a series.

    Attributes:
        time_s: time of the largest overlap, between the maps of the series [s].
        map_time_s: time of the map that overlaps best [s].
        overlap: its overlap [-].
    """

    time_s: float
    map_time_s: float
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
    """Return where the map `found` (nz, nx) belongs in a series.

    Args:
        found: phases of one photograph, row 0 at the bottom.
        series: maps of the same rig by time [s], at least one; their cells may have another size.
    """
    overlaps = {time: phase_overlap(found, _of_shape(one, found)) for time, one in series.items()}
    best = max(overlaps, key=overlaps.__getitem__)
    return SeriesMatch(_peak(overlaps, best), best, overlaps[best])


def _of_shape(phases: Phases, like: Phases) -> Phases:
    """Return a map with the cells of another one."""
    nz, nx = like.shape
    return np.asarray(cv2.resize(phases, (nx, nz), interpolation=cv2.INTER_NEAREST), np.uint8)


def _peak(overlaps: Mapping[float, float], best: float) -> float:
    """Return the time of the peak of the parabola through the best overlap and its neighbours."""
    times = sorted(overlaps)
    at = times.index(best)
    near = times[at - 1 : at + 2]
    if not 0 < at < len(times) - 1:
        return best
    curvature, slope, _ = np.polyfit(np.array(near) - best, [overlaps[one] for one in near], 2)
    if curvature >= 0.0:
        return best
    return float(np.clip(best - 0.5 * slope / curvature, near[0], near[-1]))
