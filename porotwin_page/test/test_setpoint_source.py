"""Tests of the judgement on publishers of setpoints."""

from porotwin_page.setpoint_source import LINGERING_S, SetpointSource

GUARD = '/porotwin/guard'


def test_setpoints_of_the_guard_alone_are_orders() -> None:
    source = SetpointSource(GUARD)
    assert source.doubt([GUARD], 0.0) == ''
    assert source.doubt([], 0.0) == ''


def test_another_publisher_is_named_at_once() -> None:
    source = SetpointSource(GUARD)
    for names in (['/porotwin/hub'], [GUARD, '/porotwin/hub'], ['/other/guard']):
        assert f'come from {names[-1]}' in source.doubt(names, 0.0)


def test_two_guards_are_told_once_a_dead_one_would_have_left_the_graph() -> None:
    source = SetpointSource(GUARD)
    assert source.doubt([GUARD, GUARD], 0.0) == ''
    assert source.doubt([GUARD, GUARD], LINGERING_S) == ''
    assert '2 guards' in source.doubt([GUARD, GUARD], LINGERING_S + 1.0)
    assert source.doubt([GUARD], LINGERING_S + 2.0) == ''
    assert source.doubt([GUARD, GUARD], LINGERING_S + 3.0) == ''
