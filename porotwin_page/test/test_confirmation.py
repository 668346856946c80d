"""Tests of confirmations: wrong ones are refused in one line."""

from dataclasses import replace
from typing import Any

import pytest
from page_examples import RIG, ml_h, rates, two_cycles

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate
from porotwin_page.confirmation import ConfirmationDoubt, decoded, parse
from porotwin_page.graph_snapshot import GraphSnapshot

SHOWN = ml_h(rates(120.0))


def body(**changed: Any) -> dict:
    """Return a confirmation of setpoint 2 with some rates changed [ml/h]."""
    return {'sequence': 2, 'rates_ml_h': {**SHOWN, **changed}}


def test_rates_as_shown_are_the_rates_of_the_setpoint_to_the_last_digit() -> None:
    given = parse(body(), two_cycles())
    assert given.rates == rates(120.0)
    assert not given.safe


def test_other_rates_are_converted_and_keep_the_injected_fluid() -> None:
    given = parse(body(injector=490, producer=-610), two_cycles())
    assert given.rates['injector'] == WellRate(from_ml_h(490), 1.0)
    assert given.rates['producer'] == WellRate(from_ml_h(-610), 0.0)
    assert set(given.rates) == set(rates(0.0))


def test_the_safe_rates_may_be_confirmed_after_the_end_of_a_setpoint() -> None:
    given = parse({'sequence': 2, 'orders': 'safe', 'rates_ml_h': ml_h(rates(0.0))}, two_cycles())
    assert given.safe
    assert given.rates == safe_rates(RIG)


@pytest.mark.parametrize(
    ('changed', 'words'),
    [
        ({'control1': 470.0}, '350 ml/h more is injected than produced'),
        ({'producer': -1000.0}, '380 ml/h more is produced than injected'),
        ({'control1': 600.0, 'producer': -1100.0}, 'control1 at 600.0 ml/h is above its limit of'),
    ],
)
def test_odd_rates_are_a_question_and_recorded_if_the_operator_is_sure(changed, words) -> None:
    with pytest.raises(ConfirmationDoubt) as caught:
        parse(body(**changed), two_cycles())
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)
    sure = parse({**body(**changed), 'sure': True}, two_cycles())
    assert {well: ml_h(sure.rates)[well] for well in changed} == pytest.approx(changed)


def test_without_a_description_of_the_rig_the_operator_node_judges_the_rates() -> None:
    assert parse(body(control1=-6000.0), replace(two_cycles(), rig=None)).rates['control1'].rate < 0


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (b'', 'not JSON'),
        (b'{', 'not JSON'),
        (b'\xff\xfe', 'not JSON'),
        (b'[' * 15_000, 'not JSON'),
        (b'{"sequence": NaN}', 'NaN is not a number'),
        (b'{"sequence": -Infinity}', '-Infinity is not a number'),
        (b'{"sequence": 1, "sequence": 2}', "'sequence' stands there twice"),
        (b'{"sequence": ' + b'9' * 9000 + b'}', 'not JSON'),
    ],
)
def test_a_body_that_is_no_json_is_refused_in_one_line(text, words) -> None:
    with pytest.raises(InputError, match=words) as caught:
        decoded(text)
    assert len(str(caught.value)) < 120


def test_a_number_beyond_all_floats_is_refused() -> None:
    data = decoded(b'{"sequence": 2, "rates_ml_h": {"control1": 1e999}}')
    data['rates_ml_h'] = {**SHOWN, **data['rates_ml_h']}
    with pytest.raises(InputError, match='rate inf is not a number'):
        parse(data, two_cycles())


@pytest.mark.parametrize(
    ('data', 'words'),
    [
        ([1], 'JSON object'),
        ({}, 'whole number'),
        ({'sequence': 1.5}, '1.5'),
        ({'sequence': True}, 'True'),
        ({'sequence': '2'}, "'2'"),
        ({'sequence': 9}, 'setpoint 9 is not the newest; set and confirm setpoint 2'),
        ({**body(), 'sequence': 1}, 'setpoint 1 is not the newest; set and confirm setpoint 2'),
        ({'sequence': 2, 'rate': {}}, "unknown key 'rate'"),
        ({'sequence': 2, 'rates_ml_h': [1]}, 'rate of every well'),
        (body(control9=1), "well 'control9' is not in setpoint 2"),
        ({'sequence': 2}, 'rate of every well'),
        ({'sequence': 2, 'rates_ml_h': {'control1': 1}}, 'no rate of injector, producer'),
        ({**body(), 'sure': 1}, 'sure 1'),
        ({**body(), 'orders': []}, 'orders []'),
        ({**body(), 'sequence': 10**4000}, 'setpoint'),
        (body(control1='much'), "rate 'much'"),
        (body(control1=None), 'rate None'),
        (body(control1=float('nan')), 'rate nan'),
        (body(control1=False), 'rate False'),
        (body(control1=10**400), 'is not a number'),
        (body(injector=1e300), '1e+300 ml/h is not plausible'),
        ({**body(injector=-500.0, producer=380.0), 'sure': True}, 'wrong sign'),
        ({**body(producer=620.0), 'sure': True}, 'wrong sign'),
        (body(**{'x' * 500: 1.0}), 'is not in setpoint 2'),
    ],
)
def test_every_fault_is_named_in_one_line(data, words) -> None:
    with pytest.raises(InputError) as caught:
        parse(data, two_cycles())
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_before_the_first_setpoint_there_is_nothing_to_confirm() -> None:
    with pytest.raises(InputError, match='there was none yet'):
        parse({'sequence': 1}, GraphSnapshot())
