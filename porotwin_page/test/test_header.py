"""Tests of the header of the page."""

import pytest
from page_examples import RIG, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot, Health, Level
from porotwin_page.header import header_view


def test_a_photograph_is_stale_after_three_intervals() -> None:
    def stale(steady: float) -> bool:
        return header_view(two_cycles(), steady)['photo']['stale']

    assert not stale(30.0 + 89.0)
    assert stale(30.0 + 91.0)


def test_a_finished_experiment_is_not_stale() -> None:
    view = header_view(snapshot.with_end(two_cycles(), 'all photographs taken'), 1e4)
    assert view['finished'] == 'all photographs taken'
    assert not view['photo']['stale']


def test_number_interval_and_age_of_the_photograph_are_shown() -> None:
    photo = header_view(two_cycles(), 40.0)['photo']
    assert photo['sequence'] == 2
    assert photo['interval_s'] == 30.0
    assert photo['age_s'] == pytest.approx(10.0)


def test_rig_and_worst_node_are_shown() -> None:
    report = Health(Level.WARN, 'no model', 0.0)
    view = header_view(snapshot.with_health(two_cycles(), 'costa', report), 0.0)
    assert view['rig_name'] == RIG.name
    assert view['nodes'] == {'level': 'warn', 'text': '▲ costa: no model'}


def test_before_the_first_message_the_header_is_empty() -> None:
    assert header_view(GraphSnapshot(), 0.0) == {
        'rig_name': '',
        'photo': None,
        'finished': None,
        'nodes': {'level': 'ok', 'text': ''},
    }
