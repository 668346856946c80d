"""Forecasts of the siblings for browsers."""

import numpy as np
import pytest
from page_examples import GRID, expectation

from porotwin_page.expectation import expectation_view, plume_outlines


def test_an_expectation_is_shown_in_ml_and_percent() -> None:
    view = expectation_view(expectation())
    assert view['minutes'] == [10.0, 20.0]
    assert view['zone_ml'] == {'low': [0.0, 1.0], 'median': [1.0, 2.0], 'high': [2.0, 4.0]}
    assert view['reached_percent'] == [50.0, 100.0]
    assert view['rates_ml_h']['control1'] == pytest.approx(120.0)


def test_the_outline_of_a_plume_is_closed_also_at_the_edge() -> None:
    values = np.zeros(GRID.shape)
    values[2:4, :3] = 1.0
    values[0, 0] = np.nan
    (line,) = plume_outlines(values, GRID)
    assert line[0] == line[-1]
    assert all(0.0 <= x <= GRID.width and 0.0 <= z <= GRID.height for x, z in line)


def test_a_rig_without_tracer_has_no_outline() -> None:
    assert plume_outlines(np.zeros(GRID.shape), GRID) == ()
