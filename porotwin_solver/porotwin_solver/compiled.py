"""Compiled kernels: how they are compiled, and the clock of cells that step at their own pace."""

# mypy: disable-error-code="no-untyped-def"

import numpy as np
from numba import njit
from numpy.typing import NDArray

compiled = njit(cache=True, nogil=True, error_model='numpy')
"""Compile once per machine; run without the interpreter's lock; divide as NumPy does."""


NO_TAPE = np.empty(0)
"""The tape of a run that no adjoint follows."""


def tape_length(reach: NDArray[np.int64]) -> int:
    """Return how many single steps all cells take together; `reach` as `sort_by_pace` returns."""
    with_level = reach - np.append(reach[1:], 0)
    return int((with_level << np.arange(len(reach))).sum())


DRY = 1e-15
"""Concentration below which a cell keeps what it has: round-off of the stock's, so that the tails
of the plume stay short. Nothing is lost."""


@compiled
def starting_level(step, top):
    """Return the lowest level whose cells begin a step at the finest step `step` of 2**top.

    Also the lowest level whose cells end one just before `step`; level 0 at both ends.
    """
    if step == 0:
        return 0
    level = top
    while step % 2 == 0 and level > 0:
        step //= 2
        level -= 1
    return level


@compiled
def sort_by_pace(rate, time_step, largest, level):
    """Fill `level` such that no cell turns over more than `largest` of itself in one step.

    `rate` [1/s] is the share of each cell that is turned over per time. Returns the cells ordered
    by level, the highest first, and for every level how many cells have it or a higher one.
    """
    count = np.zeros(64, np.int64)
    top = 0
    for k in range(len(rate)):
        share = rate[k] * time_step
        steps = 0
        while share > largest and steps < 40:
            share *= 0.5
            steps += 1
        level[k] = steps
        count[steps] += 1
        top = max(top, steps)
    reach = np.empty(top + 1, np.int64)
    place = np.empty(top + 1, np.int64)
    cells = 0
    for steps in range(top, -1, -1):
        place[steps] = cells
        cells += count[steps]
        reach[steps] = cells
    order = np.empty(len(rate), np.int32)
    for k in range(len(rate)):
        order[place[level[k]]] = k
        place[level[k]] += 1
    return order, reach
