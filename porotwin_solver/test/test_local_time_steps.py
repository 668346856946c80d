"""The levels of the cells and the order of their substeps."""

import numpy as np
import pytest

from porotwin_solver.transport.local_time_steps import (
    TimeStepLevels,
    assign_levels,
    lowest_starting_level,
    tape_length,
)


def test_a_cell_has_the_lowest_level_that_keeps_its_cfl_number_below_the_limit() -> None:
    rate = np.random.default_rng(1).exponential(2.0, 200)
    level = np.empty(200, np.int8)
    assign_levels(rate, 3.0, 0.5, level)
    cfl = rate * 3.0 / 2.0**level
    assert (cfl <= 0.5).all()
    assert (2.0 * cfl[level > 0] > 0.5).all()


def test_the_cells_are_ordered_by_level_and_counted() -> None:
    rate = np.random.default_rng(2).exponential(2.0, 200)
    level = np.empty(200, np.int8)
    order, count_at_least = assign_levels(rate, 3.0, 0.5, level)
    assert sorted(order) == list(range(200))
    assert (np.diff(level[order].astype(int)) <= 0).all()
    assert list(count_at_least) == [(level >= own).sum() for own in range(level.max() + 1)]
    levels = TimeStepLevels(3.0, level, order, count_at_least)
    assert tape_length(levels) == (2 ** level.astype(int)).sum()


@pytest.mark.parametrize('highest', [0, 1, 4])
def test_every_level_starts_its_own_number_of_substeps(highest) -> None:
    starts = [lowest_starting_level(substep, highest) for substep in range(2**highest)]
    for own in range(highest + 1):
        assert sum(lowest <= own for lowest in starts) == 2**own
    assert lowest_starting_level(2**highest, highest) == 0
