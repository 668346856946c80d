"""Tests of the snapshot: every message changes it as described, and its size is bounded."""

from dataclasses import replace

import numpy as np
import pytest
from page_examples import (
    GRID,
    RIG,
    START,
    after,
    expectation,
    map_at,
    observed_state,
    point,
    rates,
    setpoint,
    two_cycles,
)

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import Event, GraphSnapshot, Health, Level, Map


def test_a_state_is_compared_with_the_corrected_forecast_for_its_time() -> None:
    difference = two_cycles().difference
    assert difference is not None
    np.testing.assert_allclose(difference, 0.45 - 0.25)


def test_without_a_forecast_for_its_time_there_is_no_difference() -> None:
    late = after(
        (snapshot.with_predicted, map_at(START + 30.0)),
        (snapshot.with_observed_state, observed_state(3)),
    )
    assert late.difference is None


def test_a_forecast_on_a_finer_grid_is_averaged_to_the_observed_grid() -> None:
    fine = GRID.refined(2)
    values = np.zeros(fine.shape)
    values[::2] = 0.5
    now = after(
        (snapshot.with_predicted, Map(START, values, fine)),
        (snapshot.with_observed_state, observed_state(1, value=0.25)),
    )
    np.testing.assert_allclose(now.difference, 0.0, atol=1e-12)


def test_unseen_cells_have_no_difference() -> None:
    seen = observed_state(1)
    seen.map.concentration[2, 3] = np.nan
    now = after((snapshot.with_predicted, map_at(START)), (snapshot.with_observed_state, seen))
    assert now.difference is not None
    assert np.isnan(now.difference).sum() == 1


def test_an_interruption_drops_the_forecasts_and_adds_a_mark() -> None:
    now = snapshot.with_interruption(two_cycles(), snapshot.Mark(START + 60, 'missed'))
    now = snapshot.with_observed_state(now, observed_state(3))
    assert now.difference is None
    assert now.marks[-1].reason == 'missed'
    assert len(now.history) == 2


def test_a_new_experiment_drops_maps_and_curves_but_not_the_rates_at_the_pumps() -> None:
    now = snapshot.with_measured(two_cycles(), rates(100.0), by_person=True)
    now = replace(now, expected=expectation())
    now = snapshot.with_new_experiment(now, START + 600.0)
    assert now.observed is None
    assert now.expected is None
    assert now.history == ()
    assert now.start is None
    assert now.set_rates == rates(100.0)
    assert now.rig is not None


def test_the_first_photograph_may_arrive_before_the_start_of_its_experiment() -> None:
    now = after((snapshot.with_observed_state, observed_state(1)), (snapshot.with_cycle, point(1)))
    assert snapshot.with_new_experiment(now, START) == now


def test_a_bag_that_starts_again_from_the_same_time_is_a_new_experiment() -> None:
    now = snapshot.with_new_experiment(two_cycles(), START)
    assert now.history == ()
    assert now.observed is None


def test_the_first_photograph_of_a_bag_that_starts_again_may_arrive_before_its_start() -> None:
    now = snapshot.with_observed_state(two_cycles(), observed_state(1))
    now = snapshot.with_new_experiment(now, START)
    assert now.history == ()
    assert now.observed is not None
    assert (now.observed.map.time, now.start, now.states) == (START, START, 1)


def test_a_photograph_with_an_old_time_drops_nothing() -> None:
    old = replace(observed_state(3), map=map_at(1000.0))
    now = snapshot.with_observed_state(two_cycles(), old)
    now = snapshot.with_cycle(now, replace(point(3), time=1000.0))
    assert len(now.history) == 3
    assert now.start == START
    assert now.marks == two_cycles().marks


def test_history_keeps_the_newest_cycles_and_counts_them_all() -> None:
    now = GraphSnapshot()
    for sequence in range(1, snapshot.HISTORY_LENGTH + 11):
        now = snapshot.with_cycle(now, point(sequence))
    assert len(now.history) == snapshot.HISTORY_LENGTH
    assert now.history_end == snapshot.HISTORY_LENGTH + 10
    assert now.history[0].time == point(11).time


def test_a_cycle_takes_the_rates_of_the_setpoint_from_the_same_photograph() -> None:
    history = two_cycles().history
    assert [cycle.rates['control1'] for cycle in history] == [
        rates(100.0)['control1'],
        rates(120.0)['control1'],
    ]


def test_a_setpoint_that_arrives_after_its_report_adds_its_rates_to_the_curves() -> None:
    now = after((snapshot.with_cycle, point(1)), (snapshot.with_setpoint, setpoint(1, 70.0)))
    assert now.history[-1].rates == rates(70.0)
    now = snapshot.with_setpoint(now, setpoint(2, 80.0))
    assert now.history[-1].rates == rates(70.0)


def test_a_restarted_hub_ends_the_confirmation() -> None:
    now = snapshot.with_confirmation(two_cycles(), 1)
    now = snapshot.with_setpoint(now, setpoint(1, 50.0))
    assert now.confirmed is None
    assert [kept.sequence for kept in now.setpoints] == [1]


def test_setpoints_expiries_and_reports_are_logged_with_clock_times() -> None:
    now = replace(two_cycles(), rig=RIG)
    now = snapshot.with_measured(now, rates(100.0), by_person=True, clock=START + 40.0)
    for seconds in (119.0, 121.0, 123.0):
        now = snapshot.with_graph_time(now, START + seconds, START + seconds)
    logged = [(line.clock - START, line.event, line.sequence) for line in now.log]
    assert logged == [
        (0.0, Event.SETPOINT, 1),
        (30.0, Event.SETPOINT, 2),
        (40.0, Event.REPORTED, None),
        (121.0, Event.EXPIRED, 2),
    ]
    assert now.log[-1].rates['producer'].rate == -now.log[-1].rates['injector'].rate
    now = snapshot.with_setpoint(now, setpoint(3, 10.0))
    assert snapshot.with_graph_time(now, None, 0.0).log[-1].event is Event.SETPOINT


def test_another_nodes_word_on_a_silent_node_is_no_report_of_its_own() -> None:
    now = after(
        (snapshot.with_health, 'hub', Health(Level.OK, 'well', 10.0)),
        (snapshot.with_health, 'hub', Health(Level.OK, 'well', 11.0)),
        (snapshot.with_health, 'hub', Health(Level.SILENT, 'no report for 9 s', 20.0)),
    )
    assert now.health['hub'] == Health(Level.SILENT, 'no report for 9 s', 11.0)


def test_the_photo_interval_is_the_longer_of_recorded_and_measured() -> None:
    def three_photographs(gap: float) -> GraphSnapshot:
        return after(
            *((snapshot.with_observed_state, observed_state(k, arrival=gap * k)) for k in (1, 2, 3))
        )

    assert three_photographs(1.0).photo_interval == 30.0
    assert three_photographs(60.0).photo_interval == 60.0
    assert after((snapshot.with_observed_state, observed_state(1))).photo_interval is None


def test_made_up_names_take_no_place_of_a_node_of_the_graph() -> None:
    now = snapshot.with_health(GraphSnapshot(), 'hub', Health(Level.ERROR, 'no setpoint', 1.0))
    now = snapshot.with_nodes(now, ['hub'], 2.0)
    for number in range(2 * snapshot.MOST_KEPT):
        now = snapshot.with_health(now, f'lamp {number}', Health(Level.OK, 'lit', 3.0 + number))
    assert len(now.health) == snapshot.MOST_KEPT
    assert now.health['hub'].message == 'no setpoint'


def test_a_node_may_leave_the_graph_and_return() -> None:
    report = Health(Level.OK, 'fast, 187x112', 1.0)
    now = snapshot.with_health(GraphSnapshot(), 'solver', report)
    assert now.health['solver'].present is None
    now = snapshot.with_nodes(now, ['solver', 'hub'], 2.0)
    assert now.health['solver'].present is True
    assert now.health['hub'].level is Level.QUIET
    now = snapshot.with_nodes(now, ['hub'], 4.0)
    assert now.health['solver'].present is False
    now = snapshot.with_nodes(now, ['solver', 'hub'], 6.0)
    assert now.health['solver'].present is True
    assert now.health['solver'].message == 'fast, 187x112'


@pytest.mark.parametrize(
    ('kept', 'most', 'step'),
    [
        (
            'health',
            snapshot.MOST_KEPT,
            lambda now, k: snapshot.with_health(now, f'node{k}', Health(Level.OK, '', k)),
        ),
        (
            'setpoints',
            snapshot.MOST_KEPT,
            lambda now, k: snapshot.with_setpoint(now, setpoint(k, 1.0)),
        ),
        (
            'log',
            snapshot.MOST_KEPT,
            lambda now, k: snapshot.with_setpoint(now, setpoint(k, 1.0)),
        ),
        (
            'marks',
            snapshot.MOST_KEPT,
            lambda now, k: snapshot.with_interruption(now, snapshot.Mark(k, '')),
        ),
        (
            'predicted',
            snapshot.FORECASTS_KEPT,
            lambda now, k: snapshot.with_predicted(now, map_at(k)),
        ),
        (
            'corrected',
            snapshot.FORECASTS_KEPT,
            lambda now, k: snapshot.with_corrected(now, map_at(k)),
        ),
        (
            'arrivals',
            snapshot.ARRIVALS_KEPT,
            lambda now, k: snapshot.with_observed_state(now, observed_state(k)),
        ),
    ],
)
def test_the_size_of_a_snapshot_is_bounded(kept, most, step) -> None:
    now = GraphSnapshot()
    for k in range(1, 3 * most):
        now = step(now, k)
    assert len(getattr(now, kept)) == most
