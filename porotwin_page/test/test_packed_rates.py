"""Tests of packed rates: they are the rates, in less memory."""

import pytest
from page_examples import rates

from porotwin_page.packed_rates import PackedRates


def test_packed_rates_equal_the_rates() -> None:
    packed = PackedRates(rates(120.0))
    assert packed == rates(120.0)
    assert list(packed) == list(rates(120.0))
    assert len(packed) == 5
    assert PackedRates({}) == {}
    with pytest.raises(KeyError):
        packed['control9']


def test_wells_of_the_same_names_are_shared() -> None:
    first = PackedRates(rates(1.0))
    second = PackedRates(rates(2.0), first)
    assert second == rates(2.0)
    assert second._names is first._names
    assert PackedRates({'other': rates(1.0)['injector']}, first) == {
        'other': rates(1.0)['injector']
    }
