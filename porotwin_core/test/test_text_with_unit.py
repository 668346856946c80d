"""Tests of rates with a unit."""

import pytest

from porotwin_core.basis.text_with_unit import rate_in_ml_h


@pytest.mark.parametrize(
    ('text', 'ml_h'),
    [
        ('2 l/d', 2000.0 / 24.0),
        ('-0.5l/h', -500.0),
        ('10 \u00b5l/min', 0.6),
        ('10 ul/min', 0.6),
        ('1.5 ml/s', 5400.0),
        ('+3 ML/H', 3.0),
    ],
)
def test_a_rate_with_its_unit_is_read(text: str, ml_h: float) -> None:
    assert rate_in_ml_h(text) == pytest.approx(ml_h)


@pytest.mark.parametrize(
    'text', ['5', '2 l', 'l/d', '9 Ml/h', '2 l/week', '2**9 l/d', '1,5 l/d', '']
)
def test_any_other_text_is_no_rate_with_a_unit(text: str) -> None:
    assert rate_in_ml_h(text) is None
