"""The panel that shows what to expect, and what if."""

import pytest
from page_examples import content, expectation, two_cycles

from porotwin_page import graph_snapshot as snapshot


def test_before_the_first_forecast_the_panel_is_hidden() -> None:
    assert content('what_if', two_cycles()) is None


def test_the_panel_has_the_forecast_and_the_limits_of_the_sliders() -> None:
    shown = content('what_if', snapshot.with_expectation(two_cycles(), expectation()))
    assert shown['wells'] == ['control1', 'control2', 'control3']
    assert shown['max_rate_ml_h'] == shown['max_total_ml_h'] == 500.0
    assert shown['step_ml_h'] == pytest.approx(0.1)
    assert shown['present']['zone_ml']['median'] == [1.0, 2.0]
    assert shown['controlled']
