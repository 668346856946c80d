"""Tests of the door: states and rates that the hub lets in, and the line for a refused one."""

import math
from typing import Any

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig
from porotwin_hub.loop.door import Door, StateNumbers

PUSH = {'push': WellRate(from_ml_h(300.0))}


@pytest.fixture
def door(toy_rig: Rig, toy_grid: Grid) -> Door:
    return Door(toy_rig, toy_grid)


def test_a_map_with_holes_is_let_in(door: Door, toy_grid: Grid) -> None:
    values = np.full(toy_grid.shape, np.nan)
    values[:2] = 0.5
    door.check_state(values, toy_grid)


@pytest.mark.parametrize(
    ('shape', 'seen', 'text'),
    [
        ((20, 10), 0.0, 'its map shows 0 % of the rig; is the camera covered?'),
        ((20, 10), 0.05, 'its map shows 5 % of the rig'),
        ((10, 5), 1.0, 'its map is 10x5 over 1.0 x 0.5 m, the hub works on 20x10'),
    ],
)
def test_a_map_that_is_no_state_of_the_rig_is_refused(
    door: Door, toy_rig: Rig, shape: tuple[int, int], seen: float, text: str
) -> None:
    grid = toy_rig.grid(*shape)
    values = np.full(grid.nx * grid.nz, np.nan)
    values[: round(seen * values.size)] = 0.0
    with pytest.raises(InputError, match=text):
        door.check_state(values.reshape(grid.shape), grid)


def doubtful(*numbers: int) -> list[int]:
    """Return the numbers of states that are doubted."""
    watch = StateNumbers()
    return [number for number in numbers if watch.doubt(number)]


def test_states_of_a_second_node_are_told_by_their_numbers() -> None:
    assert doubtful(0, 1, 2, 3) == []
    assert doubtful(7, 8, 9001, 9, 10) == [9001]
    assert doubtful(7, 8, 8, 9) == [8]
    assert doubtful(7, 8, 12, 13, 14) == [12]  # three were lost
    assert doubtful(7, 8, 0, 1) == []  # imaging was started again
    watch = StateNumbers()
    watch.doubt(3)
    doubt = watch.doubt(9)
    assert doubt is not None and doubt.facts == {'number': 9, 'last': 3}


@pytest.mark.parametrize(
    ('start', 'end', 'rates', 'text'),
    [
        (60.0, 30.0, PUSH, 'they begin 30.000 s after their end'),
        (math.nan, 30.0, PUSH, 'after their end'),
        (30.0, math.nan, PUSH, 'after their end'),
        (30.0, 60.0, {'pump': WellRate()}, "well 'pump' is not in rig.yaml; known: injector"),
        (30.0, 60.0, {'push': WellRate(1e300)}, "well 'push': .*, but this rig stands at most"),
        (30.0, 60.0, {'push': WellRate(-5e-4)}, r"well 'push': -1.8e\+06 ml/h, but this rig"),
    ],
)
def test_impossible_rates_are_refused(
    door: Door, start: float, end: float, rates: Any, text: str
) -> None:
    with pytest.raises(InputError, match=text):
        door.known_rates(start, end, rates)


def test_a_closed_rig_balances_its_producer(toy_rig: Rig, toy_grid: Grid) -> None:
    sides = dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    closed = toy_rig.model_copy(update={'boundaries': toy_rig.boundaries.model_copy(update=sides)})
    rates = Door(closed, toy_grid).known_rates(0.0, 30.0, PUSH).rates
    assert rates['producer'].rate == -rates['push'].rate
