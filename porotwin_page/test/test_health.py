"""Tests of the health of the nodes."""

import pytest
from page_examples import after

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import Health, Level
from porotwin_page.health import LONGEST_TEXT, nodes_view, worst_view


def test_errors_and_warnings_come_first_and_an_absent_node_is_an_error() -> None:
    now = after(
        (snapshot.with_health, 'hub', Health(Level.OK, 'state 2 done', 10.0)),
        (snapshot.with_health, 'costa', Health(Level.WARN, 'no model', 10.0)),
        (snapshot.with_health, 'solver', Health(Level.OK, 'fast', 10.0)),
        (snapshot.with_nodes, ['hub', 'costa', 'solver', 'camera'], 11.0),
        (snapshot.with_nodes, ['hub', 'costa', 'camera'], 13.0),
    )
    lines = nodes_view(now, 14.0)
    assert [(line['name'], line['level']) for line in lines] == [
        ('solver', 'error'),
        ('costa', 'warn'),
        ('camera', 'quiet'),
        ('hub', 'ok'),
    ]
    assert lines[0]['message'] == 'not running'
    assert lines[1]['age_s'] == pytest.approx(4.0)


def test_a_command_that_looked_at_the_graph_and_ended_is_no_fault() -> None:
    now = after(
        (snapshot.with_nodes, ['hub', 'mend_desk'], 10.0),
        (snapshot.with_health, 'hub', Health(Level.OK, 'fast', 10.5)),
        (snapshot.with_nodes, ['hub'], 11.0),
    )
    assert [line['name'] for line in nodes_view(now, 11.0)] == ['hub']


def test_a_node_that_said_that_it_leaves_is_no_fault() -> None:
    now = after(
        (snapshot.with_nodes, ['player', 'hub'], 0.0),
        (snapshot.with_health, 'player', Health(Level.OK, 'running', 0.5)),
        (snapshot.with_health, 'player', Health(Level.OK, 'the bag has ended', 1.0, ended=True)),
        (snapshot.with_health, 'hub', Health(Level.OK, 'state 1 done', 1.0)),
        (snapshot.with_nodes, [], 2.0),
    )
    assert [(line['name'], line['level']) for line in nodes_view(now, 3.0)] == [
        ('hub', 'error'),
        ('player', 'quiet'),
    ]


def test_after_the_experiment_a_node_may_end() -> None:
    now = after(
        (snapshot.with_nodes, ['camera'], 0.0),
        (snapshot.with_health, 'camera', Health(Level.OK, 'photograph 2', 0.5)),
        (snapshot.with_nodes, [], 1.0),
        (snapshot.with_end, 'done'),
    )
    (line,) = nodes_view(now, 2.0)
    assert (line['level'], line['message']) == ('quiet', 'ended')


@pytest.mark.parametrize(
    ('supervised_at', 'level'), [(None, 'silent'), (1.0, 'silent'), (7.5, 'ok')]
)
def test_the_page_judges_who_is_silent_only_where_the_supervisor_does_not(
    supervised_at: float | None, level: str
) -> None:
    now = after(
        (snapshot.with_nodes, ['hub'], 0.0),
        (snapshot.with_health, 'hub', Health(Level.OK, 'state 3 done', 2.0)),
    )
    if supervised_at is not None:
        report = Health(Level.OK, 'all nodes report', supervised_at)
        now = snapshot.with_health(now, 'supervisor', report)
    found = {line['name']: line for line in nodes_view(now, 8.0)}
    assert found['hub']['level'] == level
    assert found['hub']['age_s'] == pytest.approx(6.0)
    assert worst_view([found['hub']])['level'] == ('error' if level == 'silent' else 'ok')
    told = snapshot.with_health(now, 'hub', Health(Level.SILENT, 'silent for 6 s: it hangs', 8.0))
    assert nodes_view(told, 8.0)[0]['level'] == 'silent'


@pytest.mark.parametrize(('age', 'level'), [(89.0, 'ok'), (91.0, 'silent')])
def test_the_patience_of_the_supervisor_is_that_of_the_page(age: float, level: str) -> None:
    watch = Health(Level.OK, 'all nodes report', 100.0, stale_after_s=90.0)
    now = after(
        (snapshot.with_health, 'hub', Health(Level.OK, 'state 3 done', 100.0 - age)),
        (snapshot.with_health, 'supervisor', watch),
    )
    assert {line['name']: line['level'] for line in nodes_view(now, 100.0)}['hub'] == level


def node(name: str, level: str, message: str = 'fast') -> dict:
    return {'name': name, 'level': level, 'message': message, 'age_s': 1.0}


def test_the_worst_node_is_named_with_the_number_of_others() -> None:
    nodes = [node('camera', 'error', 'gone'), node('hub', 'error'), node('costa', 'warn')]
    assert worst_view(nodes) == {'level': 'error', 'text': '✖ camera: gone (+1)'}


def test_healthy_nodes_are_counted() -> None:
    nodes = [node('camera', 'ok'), node('hub', 'quiet')]
    assert worst_view(nodes) == {'level': 'ok', 'text': '✔ 2 nodes'}
    assert worst_view(nodes[:1]) == {'level': 'ok', 'text': '✔ 1 node'}


def test_a_long_message_is_cut() -> None:
    text = worst_view([node('camera', 'error', 'x' * 200)])['text']
    assert len(text) <= LONGEST_TEXT + len('✖ ')
    assert text.endswith('x…')
