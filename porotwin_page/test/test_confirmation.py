"""Tests of confirmations: wrong ones are refused in one line."""

import pytest
from page_examples import rates, two_cycles

from porotwin_core.errors import InputError
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate
from porotwin_page.confirmation import parse
from porotwin_page.graph_snapshot import GraphSnapshot


def test_a_setpoint_confirmed_as_shown_carries_no_rates() -> None:
    assert parse({'sequence': 2}, two_cycles()).rates == {}


def test_other_rates_are_converted_and_keep_the_injected_fluid() -> None:
    given = parse({'sequence': 1, 'rates_ml_h': {'injector': 490, 'control1': 99.5}}, two_cycles())
    assert given.sequence == 1
    assert given.rates == {
        'injector': WellRate(from_ml_h(490), 1.0),
        'control1': WellRate(from_ml_h(99.5), 0.0),
    }
    assert set(given.rates) < set(rates(0.0))


@pytest.mark.parametrize(
    ('data', 'words'),
    [
        ([1], 'JSON object'),
        ({}, 'whole number'),
        ({'sequence': 1.5}, '1.5'),
        ({'sequence': True}, 'True'),
        ({'sequence': '2'}, "'2'"),
        ({'sequence': 9}, 'setpoint 9 is no longer shown; the newest is 2'),
        ({'sequence': 2, 'rate': {}}, "unknown key 'rate'"),
        ({'sequence': 2, 'rates_ml_h': [1]}, 'object of rates'),
        ({'sequence': 2, 'rates_ml_h': {'control9': 1}}, "well 'control9' is not in setpoint 2"),
        ({'sequence': 2, 'rates_ml_h': {'control1': 'much'}}, "rate 'much'"),
        ({'sequence': 2, 'rates_ml_h': {'control1': None}}, 'rate None'),
        ({'sequence': 2, 'rates_ml_h': {'control1': float('nan')}}, 'rate nan'),
        ({'sequence': 2, 'rates_ml_h': {'control1': False}}, 'rate False'),
    ],
)
def test_every_fault_is_named_in_one_line(data, words) -> None:
    with pytest.raises(InputError) as caught:
        parse(data, two_cycles())
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)


def test_before_the_first_setpoint_there_is_nothing_to_confirm() -> None:
    with pytest.raises(InputError, match='none yet'):
        parse({'sequence': 1}, GraphSnapshot())
