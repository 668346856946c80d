"""Tests of the history: every browser receives every point."""

from page_examples import START, point, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.curve_history import history_view, point_view
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json
from porotwin_page.panel_registry import all_panels


def history(now: GraphSnapshot, *, after: int) -> Json:
    return history_view(now, all_panels(), after=after)


def test_a_point_has_the_values_of_all_charts() -> None:
    view = point_view(point(2), all_panels())
    assert view['time_s'] == START + 30.0
    charts = {'forecast_error', 'zone_tracer', 'commanded_rates', 'cycle_duration'}
    assert view['values'].keys() >= charts
    assert view['values']['cycle_duration'] == {'': 1.5}


def test_only_new_points_are_sent() -> None:
    now = two_cycles()
    everything = history(now, after=-1)
    assert everything['reset']
    assert len(everything['points']) == 2
    same = history(now, after=everything['end'])
    assert not same['reset']
    assert same['begin'] == everything['end'] - 1
    assert same['points'] == everything['points'][-1:]
    more = history(snapshot.with_cycle(now, point(3)), after=everything['end'])
    assert more['begin'] == everything['end']
    assert [entry['time_s'] for entry in more['points']] == [START + 60.0]


def test_before_the_first_cycle_there_is_no_history_to_send() -> None:
    assert history(GraphSnapshot(), after=-1)['points'] == []
    assert not history(GraphSnapshot(), after=0)['reset']


def test_history_is_reset_by_an_experiment_and_for_a_browser_that_lacks_points() -> None:
    now = two_cycles()
    new = snapshot.with_cycle(snapshot.with_new_experiment(now, START + 600.0), point(1))
    assert history(new, after=1)['reset']
    assert len(history(new, after=1)['points']) == 1
    for sequence in range(3, snapshot.HISTORY_LENGTH + 10):
        now = snapshot.with_cycle(now, point(sequence))
    behind = history(now, after=2)
    assert behind['reset']
    assert len(behind['points']) == snapshot.HISTORY_LENGTH


def test_a_browser_with_all_points_drops_them_when_a_new_experiment_begins() -> None:
    now = two_cycles()
    new = snapshot.with_new_experiment(now, START + 600.0)
    begun = history(new, after=now.history_end)
    assert begun['reset']
    assert begun['points'] == []
    first = history(snapshot.with_cycle(new, point(1)), after=begun['end'])
    assert [entry['time_s'] for entry in first['points']] == [START]
    more = snapshot.with_cycle(snapshot.with_cycle(new, point(1)), point(2))
    assert not history(more, after=first['end'])['reset']


def test_a_browser_of_an_earlier_server_gets_everything() -> None:
    assert history(two_cycles(), after=700)['reset']
