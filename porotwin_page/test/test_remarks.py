"""Tests of the remarks."""

from dataclasses import replace

from page_examples import after, content, observed_state, point

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.panels.remarks import NOT_CALIBRATED


def test_remarks_of_imaging_and_hub_are_shown() -> None:
    now = after(
        (snapshot.with_observed_state, replace(observed_state(1), remarks=('saturated',))),
        (snapshot.with_cycle, replace(point(1), remarks=('no control',))),
    )
    assert content('remarks', now) == ['saturated', 'no control']


def test_a_missing_calibration_is_remarked_once() -> None:
    state = replace(observed_state(1), calibrated=False)
    assert content('remarks', after((snapshot.with_observed_state, state))) == [NOT_CALIBRATED]
    known = replace(state, remarks=('Not calibrated yet',))
    assert content('remarks', after((snapshot.with_observed_state, known))) == list(known.remarks)


def test_the_reason_of_a_missing_correction_is_remarked() -> None:
    cycle = replace(point(1), corrected=False, correction_status='withheld')
    now = after((snapshot.with_cycle, cycle))
    assert content('remarks', now) == ['forecast not corrected: withheld']


def test_a_twin_without_costa_is_no_fault() -> None:
    cycle = replace(point(1), corrected=False, correction_status='no model loaded')
    assert content('remarks', after((snapshot.with_cycle, cycle))) == []


def test_before_the_first_photograph_there_are_no_remarks() -> None:
    assert content('remarks', after()) == []
