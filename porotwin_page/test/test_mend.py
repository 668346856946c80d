"""The panel with an offer to mend the model, and the answer of a browser."""

from dataclasses import replace

import pytest
from page_examples import START, content, two_cycles

from porotwin_core.basis.errors import InputError
from porotwin_page import graph_snapshot as snapshot
from porotwin_page.mend_answer import parse_mend_answer

OFFER = snapshot.MendOffer(3, 'offered', True, START, 0.97, 'Pump injector delivers 70 %.')


def test_before_the_first_offer_the_panel_is_hidden() -> None:
    assert content('mend', two_cycles()) is None


def test_an_open_offer_waits_for_an_answer_and_a_notice_does_not() -> None:
    shown = content('mend', replace(two_cycles(), offer=OFFER))
    assert (shown['sequence'], shown['open'], shown['confidence_percent']) == (3, True, 97)
    notice = replace(two_cycles(), offer=replace(OFFER, is_open=False))
    assert not content('mend', notice)['open']


def test_an_offer_with_a_report_has_a_link_to_it() -> None:
    for report in ('', '/runs/diagnosis_01/report.html'):
        offered = replace(two_cycles(), offer=replace(OFFER, report=report))
        assert content('mend', offered)['report'] is bool(report)


@pytest.mark.parametrize(
    'wrong',
    [
        None,
        [],
        {'sequence': 1},
        {'sequence': True, 'accept': True},
        {'sequence': 10**100, 'accept': True},
        {'accept': False},
    ],
)
def test_another_answer_is_refused(wrong: object) -> None:
    assert parse_mend_answer({'sequence': 3, 'accept': False}) == (3, False)
    with pytest.raises(InputError, match='answer: send'):
        parse_mend_answer(wrong)
