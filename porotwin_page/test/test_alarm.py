"""Tests of the red line on publishers of setpoints."""

from page_examples import content

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import GraphSnapshot


def test_the_line_is_shown_as_long_as_it_holds() -> None:
    now = snapshot.with_alarm(GraphSnapshot(), '2 guards')
    assert content('alarm', now) == ['2 guards']
    assert content('alarm', snapshot.with_alarm(now, '')) == []
