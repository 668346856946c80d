"""Tests of the pump settings: units, changes and validity."""

from dataclasses import replace

import pytest
from page_examples import RIG, START, content, rates, setpoint, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot


def settings(now: GraphSnapshot, graph: float | None = START) -> dict:
    return content('pump_settings', now, graph=graph)


def wells(now: GraphSnapshot) -> dict[str, dict]:
    return {well['name']: well for well in settings(now)['wells']}


def changed(now: GraphSnapshot) -> list[str]:
    return [name for name, well in wells(now).items() if well['changed']]


def test_rates_are_shown_in_ml_h_with_their_sign() -> None:
    shown = wells(two_cycles())
    assert shown['control1']['rate_ml_h'] == pytest.approx(120.0)
    assert shown['producer']['rate_ml_h'] == pytest.approx(-620.0)
    assert shown['injector']['tracer'] == 1.0
    assert shown['producer']['tracer'] == 0.0


def test_the_time_of_the_photograph_tells_setpoints_of_one_number_apart() -> None:
    assert settings(two_cycles())['time_s'] == START + 30.0


def test_before_the_first_report_every_pump_is_to_be_set() -> None:
    assert len(changed(two_cycles())) == 5
    assert wells(two_cycles())['control1']['before_ml_h'] is None


def test_changes_are_relative_to_the_reported_rates_not_to_the_last_setpoint() -> None:
    now = snapshot.with_measured(two_cycles(), rates(90.0), by_person=True)
    assert changed(now) == ['producer', 'control1']
    assert wells(now)['control1']['before_ml_h'] == pytest.approx(90.0)
    # a setpoint that the person missed makes no difference
    now = snapshot.with_setpoint(now, setpoint(3, 120.0))
    assert changed(now) == ['producer', 'control1']


def test_pumps_that_report_follow_by_themselves() -> None:
    now = snapshot.with_measured(two_cycles(), rates(119.0), by_person=False)
    assert settings(now)['pumps_report'] is True
    assert wells(now)['control1']['before_ml_h'] == pytest.approx(100.0)
    assert wells(now)['control1']['measured_ml_h'] == pytest.approx(119.0)


def test_the_stock_in_the_bottle_follows_the_announced_rates() -> None:
    assert RIG.control is not None
    rate = RIG.control.fixed['injector'].rate_ml_h
    control = RIG.control.model_copy(update={'stock_ml': rate / 60.0})  # a minute of it
    now = replace(two_cycles(), rig=RIG.model_copy(update={'control': control}))
    assert settings(now)['bottle'] is None
    shown = settings(replace(now, began=START), START + 15.0)['bottle']
    assert shown == {
        'left_ml': pytest.approx(0.75 * rate / 60.0),
        'empty_in_s': pytest.approx(45.0),
    }


def test_the_validity_counts_down_on_the_graphs_clock_and_below_zero() -> None:
    def remaining(graph: float | None) -> float | None:
        return settings(two_cycles(), graph)['remaining_s']

    assert remaining(START + 40.0) == pytest.approx(80.0)
    assert remaining(START + 130.0) == pytest.approx(-10.0)
    assert remaining(None) is None


def test_the_validity_counts_from_the_arrival_whatever_the_cameras_clock_says() -> None:
    hours_off = replace(setpoint(3, 0.0), arrival=START + 7260.0)
    now = snapshot.with_setpoint(two_cycles(), hours_off)
    assert settings(now, START + 7270.0)['remaining_s'] == pytest.approx(80.0)
    no_time = snapshot.with_setpoint(two_cycles(), replace(hours_off, arrival=None))
    assert settings(no_time)['remaining_s'] is None


def test_a_confirmed_setpoint_is_marked() -> None:
    assert not settings(two_cycles())['confirmed']
    assert settings(snapshot.with_confirmation(two_cycles(), 2))['confirmed']


def test_after_the_end_of_a_setpoint_the_safe_rates_of_every_well_are_the_orders() -> None:
    now = snapshot.with_measured(two_cycles(), rates(120.0), by_person=True)
    now = snapshot.with_confirmation(now, 2)
    late = settings(now, START + 130.0)
    assert late['expired']
    assert late['safe']
    assert not late['confirmed']
    shown = {well['name']: (well['rate_ml_h'], well['changed']) for well in late['wells']}
    assert shown == {
        'injector': (pytest.approx(500.0), False),
        'producer': (pytest.approx(-500.0), True),
        'control1': (0.0, True),
        'control2': (0.0, False),
        'control3': (0.0, False),
    }
    assert settings(snapshot.with_confirmation(now, 2, safe=True), START + 130.0)['confirmed']


def test_without_a_control_section_the_safe_rates_are_not_known() -> None:
    no_control = RIG.model_copy(update={'control': None})
    late = settings(replace(two_cycles(), rig=no_control), START + 130.0)
    assert (late['expired'], late['safe']) == (True, False)


@pytest.mark.parametrize(('before', 'marked'), [(120.05, []), (119.1, []), (119.0, True)])
def test_a_change_below_what_a_hand_can_set_is_not_marked(before, marked) -> None:
    now = snapshot.with_measured(two_cycles(), rates(before), by_person=True)
    assert changed(now) == (['producer', 'control1'] if marked else [])


def test_a_setpoint_from_another_node_is_shown_with_a_doubt() -> None:
    foreign = replace(setpoint(3, 10.0), doubt='setpoints come from /somebody')
    assert settings(snapshot.with_setpoint(two_cycles(), foreign))['doubt'] == foreign.doubt
    assert settings(two_cycles())['doubt'] == ''


def test_the_next_pause_counts_down_from_the_start_that_imaging_told() -> None:
    assert RIG.control is not None
    control = RIG.control.with_pauses({'injector': ((1.0, 2.0),)}, None)
    now = replace(two_cycles(), rig=RIG.model_copy(update={'control': control}))
    assert settings(now)['next_change'] is None
    now = replace(now, began=START)
    begins = {'in_s': 20.0, 'rest': ['injector'], 'run': []}
    assert settings(now, START + 40.0)['next_change'] == begins
    ends = {'in_s': 50.0, 'rest': [], 'run': ['injector']}
    assert settings(now, START + 70.0)['next_change'] == ends
    assert settings(now, START + 120.0)['next_change'] is None
