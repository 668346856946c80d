"""Tests of the panel of COSTA."""

from dataclasses import replace

from page_examples import after, content, point

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.graph_snapshot import Health, Level

GATE = 'gate open for learnt physics: free-run error 0.031 instead of 0.161 on kept maps'


def _told(message: str, *cycles: snapshot.CyclePoint) -> list[str]:
    steps = [(snapshot.with_cycle, cycle) for cycle in cycles]
    return content(
        'costa_gate', after((snapshot.with_health, 'costa', Health(Level.OK, message, 1.0)), *steps)
    )


def test_the_gate_and_its_gain_are_told() -> None:
    cycles = [
        replace(point(n), corrected=True, prediction_error=0.04, corrected_error=0.01)
        for n in (1, 2)
    ]
    assert _told(GATE, *cycles) == [
        GATE,
        'newest 2 forecasts: error 1.0 %, 4.0 % without COSTA',
    ]


def test_a_correction_that_is_withheld_says_why() -> None:
    cycle = replace(point(1), corrected=False, correction_status='withheld: pumping')
    assert _told(GATE, cycle) == [GATE, 'not applied now: withheld: pumping']


def test_without_a_model_there_is_nothing_to_say() -> None:
    assert _told('no model loaded', point(1)) == []
    assert content('costa_gate', after()) == []
