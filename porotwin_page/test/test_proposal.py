"""Proposed rates as a browser sends them."""

from typing import Any

import pytest
from page_examples import two_cycles

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.proposal import parse_proposal


def test_rates_of_some_control_wells_are_a_proposal() -> None:
    rates = parse_proposal({'rates_ml_h': {'control2': 250.0}}, two_cycles())
    assert to_ml_h(rates['control2'].rate) == pytest.approx(250.0)
    assert rates['control2'].concentration == 0.0


@pytest.mark.parametrize(
    ('data', 'complaint'),
    [
        ([], 'send a JSON object'),
        ({'rates': {}}, 'send a JSON object'),
        ({'rates_ml_h': {}}, 'one control well or more'),
        ({'rates_ml_h': {'injector': 3}}, 'no control well'),
        ({'rates_ml_h': {'control1': 501}}, 'from 0 to 500 ml/h'),
        ({'rates_ml_h': {'control1': -1}}, 'from 0 to 500 ml/h'),
        ({'rates_ml_h': {'control1': True}}, 'from 0 to 500 ml/h'),
        ({'rates_ml_h': {'control1': 'much'}}, 'from 0 to 500 ml/h'),
        ({'rates_ml_h': {'control1': 300, 'control2': 300}}, 'allows 500 ml/h'),
    ],
)
def test_anything_beyond_the_limits_is_refused(data: Any, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        parse_proposal(data, two_cycles())


def test_a_rig_without_control_wells_has_no_proposals() -> None:
    with pytest.raises(InputError, match='no control wells'):
        parse_proposal({'rates_ml_h': {'control1': 1}}, GraphSnapshot())
