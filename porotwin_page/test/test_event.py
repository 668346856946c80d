"""Tests of the events for browsers: complete, and without numbers that JSON lacks."""

import json
import math
from dataclasses import replace

from page_examples import RIG, START, after, observed_state, setpoint, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.curve_history import history_view
from porotwin_page.event import event_view, rig_view
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import Moment
from porotwin_page.panel_registry import all_panels


def strict(data: dict) -> str:
    return json.dumps(data, allow_nan=False)


def test_numbers_that_are_not_finite_become_none() -> None:
    nothing = snapshot.CyclePoint(START, math.nan, math.inf, -math.inf, math.nan, corrected=True)
    unseen = observed_state(1)
    unseen.map.concentration[:] = math.nan
    now = after(
        (snapshot.with_cycle, nothing),
        (snapshot.with_observed_state, unseen),
        (snapshot.with_observed_state, replace(unseen, noise=math.inf, time_step=math.nan)),
        (snapshot.with_setpoint, replace(setpoint(1, 0.0), valid_until=math.inf)),
    )
    strict(event_view(now, Moment(START, 5.0), all_panels()))
    strict(history_view(now, all_panels(), after=-1))


def test_an_event_of_an_empty_snapshot_is_complete() -> None:
    event = event_view(GraphSnapshot(), Moment(None, 0.0), all_panels())
    strict(event)
    assert event['panels'].keys() == all_panels().keys()
    assert event['panels']['pump_settings'] is None
    maps = [event['panels'][name] for name in ('observed', 'forecast', 'difference')]
    assert maps == [None, None, None]
    assert event['rig'] is None
    assert event['rates_ml_h'] == {}


def test_rates_and_geometry_for_the_overlay_are_in_units_of_people() -> None:
    event = event_view(two_cycles(), Moment(None, 0.0), all_panels())
    assert event['rates_ml_h']['producer'] == -620.0
    assert event['rig'] == rig_view(RIG)
    assert event['rig']['width_m'] == RIG.width_m
    assert [well['name'] for well in event['rig']['wells']] == list(RIG.wells)


def test_after_the_end_of_a_setpoint_the_map_shows_the_safe_rates() -> None:
    event = event_view(two_cycles(), Moment(START + 300.0, 0.0), all_panels())
    assert event['rates_ml_h']['producer'] == -500.0


def test_interruptions_have_a_time_and_a_reason() -> None:
    now = snapshot.with_interruption(two_cycles(), snapshot.Mark(START + 45.0, 'missed'))
    event = event_view(now, Moment(None, 0.0), all_panels())
    assert event['marks'] == [{'time_s': START + 45.0, 'reason': 'missed'}]
    assert event['start_s'] == START
