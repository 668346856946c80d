"""Tests of the plausibility of rates that a person confirms."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.plausible_rates import greatest_rate_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, rig_from_maps
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.operator.confirmed_rates import (
    question_about,
    refuse_implausible,
)


def rate(ml_h: float, concentration: float = 0.0) -> WellRate:
    return WellRate(from_ml_h(ml_h), concentration)


@pytest.mark.parametrize(
    ('well', 'set_rate', 'line'),
    [
        ('injector', rate(1e300, 1.0), '1e\\+300 ml/h is not plausible'),
        ('injector', rate(-1e9, 1.0), '-1e\\+09 ml/h is not plausible'),
        ('injector', rate(5000.0, 1.0), "rig 'small' run at up to 2000 ml/h"),
        ('injector', rate(-500.0, 1.0), 'wrong sign, it puts water in; write 500'),
        ('control1', rate(-1.0), 'wrong sign'),
        ('producer', rate(500.0), 'wrong sign, it takes water out; write -500'),
        ('injector', rate(500.0), 'injects concentration 1 by rig.yaml, not 0'),
        ('control1', rate(10.0, 1.0), 'injects concentration 0 by rig.yaml, not 1'),
        ('nowhere', rate(1.0), "'nowhere' is not in the rig"),
    ],
)
def test_implausible_rates_are_refused(
    small_rig: Rig, well: str, set_rate: WellRate, line: str
) -> None:
    with pytest.raises(InputError, match=line):
        refuse_implausible({well: set_rate}, small_rig)


def test_rates_set_by_hand_beyond_the_limits_of_the_twin_are_plausible(small_rig: Rig) -> None:
    refuse_implausible(Limits.of(small_rig).safe(), small_rig)
    refuse_implausible({'control1': rate(600.0), 'producer': rate(-1100.0)}, small_rig)
    refuse_implausible({'injector': WellRate(), 'producer': WellRate()}, small_rig)


def test_without_a_control_section_the_pore_volume_says_what_is_plausible(
    unit_rig: dict[str, Any],
) -> None:
    numbers = ('depth_m', 'porosity', 'permeability_m2')
    rig = rig_from_maps(
        {key: value for key, value in unit_rig.items() if key not in numbers},
        {key: unit_rig[key] for key in numbers},
    )
    assert greatest_rate_ml_h(rig) == pytest.approx(100.0 * 0.4 * 0.01 * 1e6)
    refuse_implausible({'a': rate(-500.0)}, rig)
    assert question_about({'a': rate(-500.0)}, rig) is None
    with pytest.raises(InputError, match='not plausible'):
        refuse_implausible({'a': rate(1e9)}, rig)


def test_a_net_rate_is_asked_about_with_the_rate_that_would_balance(small_rig: Rig) -> None:
    safe = Limits.of(small_rig).safe()
    assert question_about(safe, small_rig) is None
    assert question_about({**safe, 'producer': rate(-495.0)}, small_rig) is None
    question = question_about({**safe, 'control1': rate(350.0)}, small_rig)
    assert question is not None
    assert question.startswith('350 ml/h more is injected than produced; is producer at -850.0')
    question = question_about({**safe, 'producer': rate(-1000.0)}, small_rig)
    assert question is not None
    assert '500 ml/h more is produced than injected; is producer at -500.0' in question


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(['injector', 'control1']))
def test_only_a_finite_range_is_plausible(small_rig: Rig, ml_h: float, well: str) -> None:
    fluid = 1.0 if well == 'injector' else 0.0
    try:
        refuse_implausible({well: rate(ml_h, fluid)}, small_rig)
    except InputError:
        return
    assert -1e-9 <= ml_h <= 2000.0 * (1.0 + 1e-12)
