"""Tests of the offers: asked once, answered once, and not repeated without new evidence."""

from dataclasses import replace

import pytest
from mending_examples import finding, notice, weak_pump

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.mending.offer_book import OfferBook, OfferState


@pytest.fixture
def book():
    return OfferBook(0.9)


def offered(book, found, stamp=600.0):
    changed, why_not = book.consider(found, stamp)
    assert not why_not
    return changed


def test_a_sure_finding_is_offered_and_not_twice(book):
    (offer,) = offered(book, finding())
    assert (offer.sequence, offer.state, offer.stamp) == (1, OfferState.OFFERED, 600.0)
    changed, why_not = book.consider(finding(weak_pump(0.72)), 900.0)
    assert not changed
    assert 'offer 1 already says so' in why_not


def test_a_newer_diagnosis_ends_an_offer(book):
    offered(book, finding())
    expired, new = offered(book, finding(weak_pump(well='producer')))
    assert (expired.sequence, expired.state) == (1, OfferState.EXPIRED)
    assert (new.sequence, new.state) == (2, OfferState.OFFERED)
    (expired,), why_not = book.consider(finding(confidence=0.5), 900.0)
    assert expired.state is OfferState.EXPIRED
    assert 'confidence 0.50, below 0.9' in why_not
    assert book.open is None


def test_a_cause_that_is_named_twice_in_a_row_needs_less_confidence(book):
    assert 'below 0.9' in book.consider(finding(confidence=0.85), 600.0)[1]
    assert offered(book, finding(weak_pump(0.72), confidence=0.82), 900.0)[0].sequence == 1


def test_an_unexplained_gap_between_two_namings_contradicts_neither(book):
    assert book.consider(finding(confidence=0.85), 600.0)[1]
    unexplained = replace(finding(confidence=0.53), verdict='unexplained', effects=())
    assert 'no known effect explains' in book.consider(unexplained, 900.0)[1]
    assert offered(book, finding(weak_pump(0.72), confidence=0.82), 1200.0)[0].sequence == 1


def test_no_gap_between_two_namings_contradicts_the_first(book):
    assert book.consider(finding(confidence=0.85), 600.0)[1]
    assert book.consider(replace(finding(), verdict='none', effects=()), 900.0)[1]
    assert 'below 0.9' in book.consider(finding(confidence=0.85), 1200.0)[1]


@pytest.mark.parametrize(
    ('first', 'second'),
    [
        (finding(confidence=0.71), finding(confidence=0.85)),
        (finding(confidence=0.85), finding(confidence=0.71)),
        (finding(weak_pump(well='producer'), confidence=0.85), finding(confidence=0.85)),
    ],
)
def test_doubtful_or_different_causes_do_not_add_up(book, first, second):
    assert book.consider(first, 600.0)[1]
    assert book.consider(second, 900.0)[1]
    assert book.newest is None


@pytest.mark.parametrize('end', ['refuse', 'take_back'])
def test_a_declined_cause_is_offered_again_only_with_a_larger_gap(book, end):
    offered(book, finding(before=0.2))
    if end == 'refuse':
        assert book.refuse().state is OfferState.REFUSED
    else:
        book.accept()
        assert book.take_back('worse').state is OfferState.TAKEN_BACK
    assert 'declined before' in book.consider(finding(before=0.21), 900.0)[1]
    assert offered(book, finding(before=0.3))[-1].sequence == 2


def test_answers_that_come_twice_or_too_late_are_refused_with_a_reason(book):
    with pytest.raises(InputError, match='nothing has been offered yet'):
        book.check(1)
    offered(book, finding())
    with pytest.raises(InputError, match='offer 7 does not exist; the newest is 1'):
        book.check(7)
    book.check(1)
    book.accept()
    with pytest.raises(InputError, match='offer 1 is accepted already'):
        book.check(1)
    offered(book, finding(weak_pump(well='producer')))
    with pytest.raises(InputError, match='offer 1 is not open any more: offer 2 has followed'):
        book.check(1)


def test_a_notice_waits_for_nobody_and_is_given_once(book):
    (offer,) = offered(book, notice())
    assert book.open is None
    with pytest.raises(InputError, match='only a notice'):
        book.check(offer.sequence)
    assert 'declined before' in book.consider(notice(), 900.0)[1]


def leak(x, z, rate):
    return EffectDescription(name='leak', parameters={'x': x, 'z': z, 'rate': rate})


def test_a_leak_elsewhere_is_another_cause():
    book = OfferBook(0.9)
    book.consider(finding(leak(0.1, 0.1, 20.0)), 1200.0)
    book.refuse()
    assert 'declined' in book.consider(finding(leak(0.12, 0.1, 18.0)), 2400.0)[1]
    changed, _ = book.consider(finding(leak(0.8, 0.5, -60.0)), 3600.0)
    assert changed[-1].state is OfferState.OFFERED


def test_two_leaks_are_known_again_in_another_order_and_are_another_cause_than_one():
    left, right = leak(0.1, 0.1, 20.0), leak(0.8, 0.5, 25.0)
    both = finding(left, right)
    assert both.has_the_cause_of(finding(right, left))
    assert both.has_the_size_of(finding(right, left))
    assert not both.has_the_size_of(finding(leak(0.8, 0.5, 50.0), left))
    assert not both.has_the_cause_of(finding(left))
    assert not finding(left).has_the_cause_of(both)
    assert not both.has_the_cause_of(finding(left, leak(0.4, 0.5, 25.0)))


def test_another_size_of_the_same_cause_replaces_the_offer():
    book = OfferBook(0.9)
    book.consider(finding(weak_pump(0.7)), 1200.0)
    assert 'already says so' in book.consider(finding(weak_pump(0.72)), 2400.0)[1]
    void, new = book.consider(finding(weak_pump(0.95)), 3600.0)[0]
    assert (void.state, new.state) == (OfferState.EXPIRED, OfferState.OFFERED)
    assert new.finding.effects == (weak_pump(0.95),)
