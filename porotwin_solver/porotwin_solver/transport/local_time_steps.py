"""Local time stepping: every cell divides a common time step into its own number of substeps.

A cell of level l takes 2**l substeps of `duration / 2**l`. The level is the lowest one that keeps
the cell's CFL number below a limit. A cell next to a well may need many substeps while a distant
cell needs one. The cost grows with the sum of the CFL numbers, not with the largest one (Osher and
Sanders, Math. Comp. 41 (1983) 321-336).
"""

# mypy: disable-error-code="no-untyped-def"

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_solver.coefficients.compiled import compiled

HIGHEST_LEVEL = 40
"""Bound on the level of a cell, so that an infinite rate cannot loop for ever."""

NO_TAPE = np.empty(0)
"""The tape of a run that records nothing."""


class TimeStepLevels(NamedTuple):
    """The substeps that the cells take within `duration` [s].

    level: (nz, nx); a cell takes 2**level substeps.
    order: (nz * nx,); flat indices of the cells, the highest level first.
    count_at_least: (levels,); the number of cells with level l or a higher one.
    """

    duration: float
    level: NDArray[np.int8]
    order: NDArray[np.int32]
    count_at_least: NDArray[np.int64]

    def of(self, chosen: NDArray[np.bool_]) -> 'TimeStepLevels':
        """Return the substeps of the `chosen` cells (nz * nx,) alone."""
        kept = chosen[self.order]
        count = np.concatenate([[0], np.cumsum(kept)])[self.count_at_least]
        return self._replace(order=self.order[kept], count_at_least=count)


def tape_length(levels: TimeStepLevels) -> int:
    """Return the number of substeps of all cells together: the length of the tape of a run."""
    return substeps(levels.count_at_least)


def substeps(count_at_least: NDArray[np.int64]) -> int:
    """Return the substeps of all cells together, as `tape_length`."""
    first, *higher = count_at_least.tolist()
    # 2**l = 1 + 1 + 2 + 4 ... + 2**(l - 1); integers of Python, which cannot overflow
    return int(first + sum(cells << below for below, cells in enumerate(higher)))


@compiled
def lowest_starting_level(substep, highest):
    """Return the lowest level whose cells start a substep at the finest substep `substep`.

    There are 2**highest finest substeps. The same cells end a substep just before it. The answer is
    level 0 at the first one and after the last one.
    """
    if substep == 0:
        return 0
    level = highest
    while substep % 2 == 0 and level > 0:
        substep //= 2
        level -= 1
    return level


@compiled
def assign_levels(rate, duration, limit, level):
    """Fill `level` (cells,) such that rate * duration / 2**level <= limit in every cell.

    `rate` (cells,) [1/s] is the CFL number of each cell per time, `duration` is [s].
    Returns `order` and `count_at_least` as in `TimeStepLevels`.
    """
    count = np.zeros(HIGHEST_LEVEL + 1, np.int64)
    highest = 0
    for k in range(len(rate)):
        cfl = rate[k] * duration
        own = 0
        while cfl > limit and own < HIGHEST_LEVEL:
            cfl *= 0.5
            own += 1
        level[k] = own
        count[own] += 1
        highest = max(highest, own)
    count_at_least = np.empty(highest + 1, np.int64)
    place = np.empty(highest + 1, np.int64)
    cells = 0
    for own in range(highest, -1, -1):
        place[own] = cells
        cells += count[own]
        count_at_least[own] = cells
    order = np.empty(len(rate), np.int32)
    for k in range(len(rate)):
        order[place[level[k]]] = k
        place[level[k]] += 1
    return order, count_at_least
