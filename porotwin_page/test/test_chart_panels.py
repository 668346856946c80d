"""Tests of the charts: units, and gaps where there is no number."""

from dataclasses import replace

import pytest
from page_examples import point, rates

from porotwin_page.panel_registry import all_panels


def values(chart: str, cycle) -> dict:
    return all_panels()[chart].point(cycle)


def test_errors_are_shown_in_percent() -> None:
    shown = values('forecast_error', point(2, 0.125))
    assert shown['model alone'] == pytest.approx(12.5)
    assert shown['corrected'] == pytest.approx(6.25)
    assert shown['expected'] is None
    told = values('forecast_error', replace(point(2), expected_error=0.04))
    assert told['expected'] == pytest.approx(4.0)


def test_an_error_without_correction_is_not_shown_as_a_corrected_one() -> None:
    assert values('forecast_error', replace(point(2), corrected=False))['corrected'] is None


def test_tracer_is_shown_in_ml() -> None:
    assert values('zone_tracer', point(2)) == {'': pytest.approx(2.0)}
    aimed = replace(point(2), tracer_place='missing in the target')
    assert values('zone_tracer', aimed) == {'missing in the target': pytest.approx(2.0)}


def test_rates_are_shown_in_ml_h_by_well() -> None:
    shown = values('commanded_rates', replace(point(2), rates=rates(120.0)))
    assert shown['control1'] == pytest.approx(120.0)
    assert shown['producer'] == pytest.approx(-620.0)


def test_the_duration_of_a_cycle_is_shown_in_seconds() -> None:
    assert values('cycle_duration', point(2)) == {'': 1.5}
