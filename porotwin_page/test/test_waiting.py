"""Tests of the lines on missing parts of the page."""

from dataclasses import replace

from page_examples import RIG, after, content, observed_state, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot


def test_before_the_first_message_it_names_everything() -> None:
    assert content('waiting', GraphSnapshot()) == [
        'the description of the rig, from the node hub',
        'the first photograph, but no node brings photographs yet',
    ]


def test_it_names_what_is_still_missing() -> None:
    now = after((replace, {'rig': RIG}), (snapshot.with_nodes, ['camera'], 0.0))
    assert content('waiting', now) == [
        'the first photograph, from the node camera',
        'the first setpoint, from the nodes hub and guard',
    ]
    now = snapshot.with_observed_state(now, observed_state(1))
    assert content('waiting', now)[0] == 'the first forecast, from the node solver'
    assert content('waiting', two_cycles()) == []


def test_the_preparation_of_a_demo_comes_first() -> None:
    now = replace(GraphSnapshot(), preparation='the demo trains COSTA')
    assert content('waiting', now)[0] == 'the demo trains COSTA'
    now = snapshot.with_observed_state(now, observed_state(1))
    assert 'the demo trains COSTA' not in content('waiting', now)


def test_a_twin_without_control_does_not_wait_for_a_setpoint() -> None:
    assert content('waiting', replace(two_cycles(), setpoints=())) == []


def test_nothing_is_missing_after_the_end() -> None:
    assert content('waiting', snapshot.with_end(GraphSnapshot(), 'done')) == []
