"""Tests of the earlier states: complete, bounded, and not in memory."""

import numpy as np
import pytest
from page_examples import GRID, RIG, START, map_at, observed_state, rates, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot, Map, ObservedState
from porotwin_page.past_states import PastStates


@pytest.fixture
def past():
    states = PastStates(most=4)
    yield states
    states.close()


def test_a_state_comes_back_with_its_forecast_difference_and_rates(past) -> None:
    now = two_cycles()
    past.add(now)
    found = past.snapshot(1, GraphSnapshot(rig=RIG))
    assert found.rig is RIG
    assert found.observed.sequence == 2
    assert found.observed.map.time == START + 30.0
    assert found.setpoint.rates == rates(120.0)
    np.testing.assert_allclose(found.observed.map.concentration, 0.45, atol=1e-3)
    np.testing.assert_allclose(found.forecast.concentration, 0.25, atol=1e-3)
    np.testing.assert_allclose(found.difference, 0.2, atol=1e-3)
    assert found.corrected
    assert not found.predicted
    assert found.history[-1].corrected


def test_what_was_not_there_stays_absent(past) -> None:
    seen = observed_state(1)
    seen.map.concentration[2, 3] = np.nan
    past.add(snapshot.with_observed_state(GraphSnapshot(), seen))
    found = past.snapshot(1, GraphSnapshot())
    assert found.forecast is None
    assert found.difference is None
    assert found.setpoint is None
    assert np.isnan(found.observed.map.concentration).sum() == 1


def test_the_oldest_state_gives_way(past) -> None:
    now = GraphSnapshot()
    assert (past.first, past.last) == (0, 0)
    for sequence in range(1, 8):
        now = snapshot.with_observed_state(now, observed_state(sequence, value=0.1 * sequence))
        past.add(now)
    assert (past.first, past.last) == (4, 7)
    assert past.snapshot(3, now) is None
    for number in range(4, 8):
        values = past.snapshot(number, now).observed.map.concentration
        np.testing.assert_allclose(values, 0.1 * number, atol=1e-3)


def test_the_size_of_the_file_is_bounded() -> None:
    states = PastStates(most=100, most_bytes=3 * (4096 + 6 * GRID.nx * GRID.nz))
    for _ in range(5):
        states.add(two_cycles())
    assert (states.first, states.last) == (3, 5)
    states.close()


def test_another_grid_begins_anew(past) -> None:
    past.add(two_cycles())
    finer = GRID.refined(2)
    state = ObservedState(9, Map(START, np.zeros(finer.shape), finer), arrival=0.0)
    past.add(snapshot.with_observed_state(GraphSnapshot(), state))
    assert (past.first, past.last) == (2, 2)
    assert past.snapshot(1, GraphSnapshot()) is None
    assert past.snapshot(2, GraphSnapshot()).observed.map.grid == finer


def test_a_forecast_on_another_grid_is_left_out(past) -> None:
    finer = GRID.refined(2)
    now = snapshot.with_predicted(GraphSnapshot(), Map(START, np.zeros(finer.shape), finer))
    past.add(snapshot.with_observed_state(now, observed_state(1)))
    assert past.snapshot(1, now).forecast is None
    assert map_at(START).grid == GRID


def test_without_places_nothing_is_kept() -> None:
    states = PastStates(most=0)
    states.add(two_cycles())
    assert (states.first, states.last) == (0, 0)
    assert states.snapshot(1, GraphSnapshot()) is None
