"""Tests of the log of setpoints."""

from page_examples import START, content, rates, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import MOST_KEPT, GraphSnapshot


def test_lines_have_clock_times_and_rates_the_newest_first() -> None:
    now = snapshot.with_measured(two_cycles(), rates(118.0), by_person=True, clock=START + 41.0)
    newest, second, first = content('setpoint_log', now)
    assert newest == {
        'clock_s': START + 41.0,
        'event': 'reported',
        'sequence': None,
        'rates_ml_h': newest['rates_ml_h'],
    }
    assert newest['rates_ml_h']['control1'] == 118.0
    assert (second['event'], second['sequence']) == ('setpoint', 2)
    assert (first['sequence'], first['clock_s']) == (1, START)


def test_only_the_newest_lines_are_shown() -> None:
    now = GraphSnapshot()
    for k in range(2 * MOST_KEPT):
        now = snapshot.with_measured(now, rates(k), by_person=True, clock=START + k)
    lines = content('setpoint_log', now)
    assert len(lines) == MOST_KEPT
    assert lines[0]['clock_s'] == START + 2 * MOST_KEPT - 1
