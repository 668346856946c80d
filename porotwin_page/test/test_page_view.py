"""What browsers are told: units, words, what changed, what is stale; and never a NaN."""

import json
import math
from dataclasses import replace

import pytest
from page_examples import START, after, observation, point, rates, setpoint, two_cycles

from porotwin_page import snapshot
from porotwin_page.snapshot import Health, Level, Snapshot
from porotwin_page.view import history_view, point_view, state_view


def wells(now: Snapshot) -> dict[str, dict]:
    view = state_view(now, now=START, steady=0.0)
    return {well['name']: well for well in view['setpoint']['wells']}


def changed(now: Snapshot) -> list[str]:
    return [name for name, well in wells(now).items() if well['changed']]


def strict(data: dict) -> str:
    return json.dumps(data, allow_nan=False)


def test_rates_are_shown_in_ml_h_with_their_sign() -> None:
    shown = wells(two_cycles())
    assert shown['control1']['rate_ml_h'] == pytest.approx(120.0)
    assert shown['producer']['rate_ml_h'] == pytest.approx(-620.0)
    assert shown['injector']['tracer'] == 1.0
    assert shown['producer']['tracer'] == 0.0


def test_before_anybody_said_what_is_set_every_pump_is_to_be_set() -> None:
    assert len(changed(two_cycles())) == 5
    assert wells(two_cycles())['control1']['before_ml_h'] is None


def test_what_changed_is_what_differs_from_what_the_person_set_not_from_the_last_setpoint() -> None:
    now = snapshot.with_measured(two_cycles(), rates(90.0), by_person=True)
    assert changed(now) == ['producer', 'control1']
    assert wells(now)['control1']['before_ml_h'] == pytest.approx(90.0)
    # a setpoint was missed by the person: it still counts
    now = snapshot.with_setpoint(now, setpoint(3, 120.0))
    assert changed(now) == ['producer', 'control1']


def test_pumps_that_report_follow_by_themselves() -> None:
    now = snapshot.with_measured(two_cycles(), rates(119.0), by_person=False)
    view = state_view(now, now=START, steady=0.0)
    assert view['setpoint']['pumps_report'] is True
    assert wells(now)['control1']['before_ml_h'] == pytest.approx(100.0)
    assert wells(now)['control1']['measured_ml_h'] == pytest.approx(119.0)


def test_the_validity_counts_down_on_the_graphs_clock_and_below_zero() -> None:
    def remaining(now: float | None) -> float | None:
        return state_view(two_cycles(), now=now, steady=0.0)['setpoint']['remaining_s']

    assert remaining(START + 40.0) == pytest.approx(80.0)
    assert remaining(START + 130.0) == pytest.approx(-10.0)
    assert remaining(None) is None


def test_the_validity_counts_from_the_arrival_whatever_the_cameras_clock_says() -> None:
    hours_off = replace(setpoint(3, 0.0), arrival=START + 7260.0)
    now = snapshot.with_setpoint(two_cycles(), hours_off)
    view = state_view(now, now=START + 7270.0, steady=0.0)
    assert view['setpoint']['remaining_s'] == pytest.approx(80.0)
    no_time = snapshot.with_setpoint(two_cycles(), replace(hours_off, arrival=None))
    assert state_view(no_time, now=START, steady=0.0)['setpoint']['remaining_s'] is None


def test_a_photograph_is_stale_after_three_intervals() -> None:
    def stale(steady: float) -> bool:
        return state_view(two_cycles(), now=None, steady=steady)['photo']['stale']

    assert not stale(30.0 + 89.0)
    assert stale(30.0 + 91.0)


def test_a_finished_experiment_is_not_stale() -> None:
    now = snapshot.with_end(two_cycles(), 'all photographs taken')
    view = state_view(now, now=None, steady=1e4)
    assert view['finished'] == 'all photographs taken'
    assert not view['photo']['stale']


def test_errors_are_percent_tracer_is_ml() -> None:
    view = point_view(point(2, 0.125))
    assert view['predicted_percent'] == pytest.approx(12.5)
    assert view['corrected_percent'] == pytest.approx(6.25)
    assert view['zone_ml'] == pytest.approx(2.0)


def test_an_error_without_correction_is_not_shown_as_a_corrected_one() -> None:
    assert point_view(replace(point(2), corrected=False))['corrected_percent'] is None


def test_numbers_that_are_not_finite_become_none() -> None:
    nothing = snapshot.CyclePoint(START, math.nan, math.inf, -math.inf, math.nan, corrected=True)
    seen = observation(1)
    seen.map.concentration[:] = math.nan
    now = after(
        (snapshot.with_cycle, nothing),
        (snapshot.with_observation, seen),
        (snapshot.with_observation, replace(seen, noise=math.inf, time_step=math.nan)),
        (snapshot.with_setpoint, replace(setpoint(1, 0.0), valid_until=math.inf)),
    )
    strict(state_view(now, now=START, steady=5.0))
    strict(history_view(now, after=-1))


def test_an_empty_page_can_be_shown() -> None:
    view = state_view(Snapshot(), now=None, steady=0.0)
    strict(view)
    assert view['setpoint'] is None
    assert view['maps'] == {'observed': None, 'forecast': None, 'difference': None}


def test_the_share_that_was_not_seen_is_told() -> None:
    seen = observation(1)
    seen.map.concentration[0] = math.nan
    view = state_view(after((snapshot.with_observation, seen)), now=None, steady=0.0)
    assert view['maps']['observed']['unseen_percent'] == pytest.approx(
        100 / 7, rel=0.05
    )  # two digits


def test_the_forecast_shown_is_the_newest_corrected_one() -> None:
    view = state_view(two_cycles(), now=None, steady=0.0)
    assert view['maps']['forecast']['time_s'] == START + 60.0
    assert view['maps']['difference']['limit'] == 0.2


def test_nodes_in_trouble_come_first_and_an_absent_one_is_an_error() -> None:
    now = after(
        (snapshot.with_health, 'hub', Health(Level.OK, 'state 2 done', 10.0)),
        (snapshot.with_health, 'costa', Health(Level.WARN, 'no model', 10.0)),
        (snapshot.with_health, 'solver', Health(Level.OK, 'fast', 10.0)),
        (snapshot.with_nodes, ['hub', 'costa', 'solver', 'camera'], 11.0),
        (snapshot.with_nodes, ['hub', 'costa', 'camera'], 13.0),
    )
    lines = state_view(now, now=None, steady=20.0)['health']
    assert [(line['name'], line['level']) for line in lines] == [
        ('solver', 'error'),
        ('costa', 'warn'),
        ('camera', 'quiet'),
        ('hub', 'ok'),
    ]
    assert lines[0]['message'] == 'not running'
    assert lines[1]['age_s'] == pytest.approx(10.0)


def test_history_sends_only_what_is_new() -> None:
    now = two_cycles()
    everything = history_view(now, after=-1)
    assert everything['reset']
    assert len(everything['points']) == 2
    same = history_view(now, after=everything['end'])
    assert not same['reset']
    assert same['begin'] == everything['end'] - 1
    assert same['points'] == everything['points'][-1:]
    more = history_view(snapshot.with_cycle(now, point(3)), after=everything['end'])
    assert more['begin'] == everything['end']
    assert [entry['time_s'] for entry in more['points']] == [START + 60.0]


def test_before_the_first_cycle_there_is_no_history_to_send() -> None:
    assert history_view(Snapshot(), after=-1)['points'] == []
    assert not history_view(Snapshot(), after=0)['reset']


def test_after_the_experiment_a_node_may_end() -> None:
    now = after(
        (snapshot.with_nodes, ['camera'], 0.0),
        (snapshot.with_nodes, [], 1.0),
        (snapshot.with_end, 'done'),
    )
    (line,) = state_view(now, now=None, steady=2.0)['health']
    assert (line['level'], line['message']) == ('quiet', 'ended')


def test_history_starts_anew_with_an_experiment_and_for_a_browser_that_fell_behind() -> None:
    now = two_cycles()
    anew = snapshot.with_cycle(snapshot.with_new_experiment(now, START + 600.0), point(1))
    assert history_view(anew, after=1)['reset']
    assert len(history_view(anew, after=1)['points']) == 1
    for sequence in range(3, snapshot.HISTORY_LENGTH + 10):
        now = snapshot.with_cycle(now, point(sequence))
    behind = history_view(now, after=2)
    assert behind['reset']
    assert len(behind['points']) == snapshot.HISTORY_LENGTH


def test_a_browser_of_an_earlier_page_gets_everything() -> None:
    assert history_view(two_cycles(), after=700)['reset']
