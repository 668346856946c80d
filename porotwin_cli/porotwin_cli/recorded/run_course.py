"""The course of a long run: its maps, and moments between them that show the progress.

A slow rig may be simulated for minutes from one map to the next. Moments between them tell how far
the run has come. They lie at whole time steps, so they hardly change the maps.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

PARTS = 20
"""Parts of a run whose progress is told."""

MANY_STEPS = 1000
"""Least number of steps between two maps that have moments between them."""


class CourseMoment(NamedTuple):
    """A `time` [s] of a run, and whether its map is wanted."""

    time: float
    is_map: bool = True


def run_course(times: Sequence[float], step: float) -> list[CourseMoment]:
    """Return the ascending `times` [s] of maps, with moments between maps that lie far apart.

    `step` is the time step of the run [s], which begins at 0.
    """
    if not times:
        return []
    part = step * max(1, math.ceil(times[-1] / (PARTS * step)))
    found: list[CourseMoment] = []
    for begin, end in itertools.pairwise((0.0, *times)):
        if end - begin > MANY_STEPS * step:
            count = math.ceil((end - begin) / part) - 1
            found += [CourseMoment(begin + number * part, False) for number in range(1, count + 1)]
        found.append(CourseMoment(end))
    return found
