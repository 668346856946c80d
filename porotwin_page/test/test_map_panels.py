"""Tests of the panels observed, forecast and difference, and of map panels in general."""

import math

import cv2
import numpy as np
import pytest
from page_examples import GRID, START, after, content, map_at, observed_state, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.map_pictures import colour_table
from porotwin_page.panel_registry import all_panels

MAPS = ('observed', 'forecast', 'difference')
COLOURS = colour_table('concentration', 'light')


def decoded(data: bytes | None) -> np.ndarray:
    assert data is not None
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize('theme', ['light', 'dark'])
@pytest.mark.parametrize('name', MAPS)
def test_every_map_has_a_pixel_for_every_cell(name, theme) -> None:
    panel = all_panels()[name]
    assert decoded(panel.picture(two_cycles(), theme)).shape == (*GRID.shape, 4)
    assert decoded(panel.scale(theme)).shape == (1, 256, 4)


@pytest.mark.parametrize('name', MAPS)
def test_a_map_that_is_missing_has_no_picture_and_no_content(name) -> None:
    assert all_panels()[name].picture(GraphSnapshot(), 'light') is None
    assert content(name, GraphSnapshot()) is None


def test_the_picture_shows_the_observed_map() -> None:
    state = observed_state(1, value=0.0)
    state.map.concentration[-1, 0] = 1.0
    now = after((snapshot.with_observed_state, state))
    pixels = decoded(all_panels()['observed'].picture(now, 'light'))
    np.testing.assert_array_equal(pixels[0, 0], COLOURS[255])
    assert (pixels.reshape(-1, 4)[1:] == COLOURS[0]).all()


def test_the_percentage_of_unseen_cells_is_shown() -> None:
    assert content('observed', two_cycles())['notes'] == []
    state = observed_state(1)
    state.map.concentration[0] = math.nan  # one row of seven
    view = content('observed', after((snapshot.with_observed_state, state)))
    assert view['notes'] == ['14 % not seen (hatched)']


def test_the_newest_corrected_forecast_is_shown() -> None:
    view = content('forecast', two_cycles())
    assert view['time_s'] == START + 60.0
    assert view['notes'] == ['corrected']
    later = snapshot.with_predicted(two_cycles(), map_at(START + 90.0))
    assert content('forecast', later)['time_s'] == START + 90.0
    alone = after((snapshot.with_predicted, map_at(START)))
    assert content('forecast', alone)['notes'] == ['not corrected']


def test_the_difference_has_a_symmetric_scale_and_the_time_of_the_photograph() -> None:
    view = content('difference', two_cycles())
    assert (view['low'], view['high']) == (-0.2, 0.2)
    assert view['time_s'] == START + 30.0
