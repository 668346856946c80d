"""Tests of the red line on publishers of setpoints."""

from dataclasses import replace

from page_examples import content

from porotwin_page.graph_snapshot import GraphSnapshot


def test_the_line_is_shown_as_long_as_it_holds() -> None:
    now = replace(GraphSnapshot(), alarm='2 guards')
    assert content('alarm', now) == ['2 guards']
    assert content('alarm', replace(now, alarm='')) == []
