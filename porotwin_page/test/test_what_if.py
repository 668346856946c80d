"""The panel that shows what to expect, and what if."""

from dataclasses import replace

import pytest
from page_examples import content, expectation, two_cycles


def test_before_the_first_forecast_the_panel_is_hidden() -> None:
    assert content('what_if', two_cycles()) is None


def test_the_panel_has_the_forecast_and_the_limits_of_the_sliders() -> None:
    shown = content('what_if', replace(two_cycles(), expected=expectation()))
    assert shown['wells'] == ['control1', 'control2', 'control3']
    assert shown['max_rate_ml_h'] == shown['max_total_ml_h'] == 500.0
    assert shown['step_ml_h'] == pytest.approx(0.1)
    assert shown['present']['zone_ml']['median'] == [1.0, 2.0]
    assert shown['controlled']


def test_a_slider_ends_where_the_producer_can_take_no_more() -> None:
    cycles = replace(two_cycles(), expected=expectation())
    control = cycles.rig.control.model_copy(update={'max_producer_rate_ml_h': 700.0})
    rig = cycles.rig.model_copy(update={'control': control})
    shown = content('what_if', replace(cycles, rig=rig))
    assert shown['max_total_ml_h'] == 700.0 - control.most_fixed_ml_h
