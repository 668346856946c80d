"""Tests of rates that a person tells: impossible ones are refused, odd ones are doubted."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.told_rates import (
    doubts_about,
    greatest_rate_ml_h,
    imbalance,
    other_fluids,
    refuse_impossible,
)
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
SAFE = safe_rates(RIG)
UNCONTROLLED = RIG.model_copy(update={'control': None})
CLOSED = RIG.model_copy(
    update={'boundaries': RIG.boundaries.model_copy(update={'top': 'closed', 'bottom': 'closed'})}
)


def rate(ml_h: float, concentration: float = 0.0) -> WellRate:
    return WellRate(from_ml_h(ml_h), concentration)


@pytest.mark.parametrize(
    ('well', 'ml_h', 'line'),
    [
        ('injector', 1e300, '1e\\+300 ml/h is not plausible'),
        ('injector', 5000.0, "rig 'small' run at up to 2000 ml/h"),
        ('injector', -500.0, 'wrong sign, it puts water in; write 500'),
        ('control1', -1.0, 'wrong sign'),
        ('producer', 500.0, 'wrong sign, it takes water out; write -500'),
        ('nowhere', 1.0, "'nowhere' is not in the rig; known: "),
    ],
)
def test_impossible_rates_are_refused(well: str, ml_h: float, line: str) -> None:
    with pytest.raises(InputError, match=line):
        refuse_impossible({well: rate(ml_h)}, RIG)


def test_rates_set_by_hand_beyond_the_limits_of_the_twin_are_possible() -> None:
    refuse_impossible(SAFE, RIG)
    refuse_impossible({'control1': rate(600.0), 'producer': rate(-1100.0)}, RIG)
    refuse_impossible({'injector': WellRate(), 'control1': rate(-0.04)}, RIG)


def test_without_a_control_section_the_pore_volume_says_what_is_plausible() -> None:
    greatest = greatest_rate_ml_h(UNCONTROLLED)
    assert greatest == pytest.approx(100.0 * 1e6 * RIG.pore_volume)
    refuse_impossible({'control1': rate(-0.999 * greatest)}, UNCONTROLLED)
    with pytest.raises(InputError, match='not plausible'):
        refuse_impossible({'control1': rate(1.001 * greatest)}, UNCONTROLLED)
    assert doubts_about({'control1': rate(-500.0)}, UNCONTROLLED) == []


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(['injector', 'control1']))
def test_only_a_finite_range_is_possible(ml_h: float, well: str) -> None:
    try:
        refuse_impossible({well: rate(ml_h)}, RIG)
    except InputError:
        return
    assert -0.0501 <= ml_h <= 2000.0 * (1.0 + 1e-12)


def test_another_fluid_than_that_of_rig_yaml_is_found() -> None:
    told = {'injector': rate(500.0), 'control1': rate(10.0, 1.0), 'control2': rate(0.0, 1.0)}
    assert other_fluids(told, RIG) == {'injector': 1.0, 'control1': 0.0}
    assert other_fluids(told, UNCONTROLLED) == {}


@pytest.mark.parametrize(
    ('changed', 'words'),
    [
        ({'control1': 350.0}, '350 ml/h more is injected than produced; is producer at -850.0'),
        ({'producer': -1000.0}, '500 ml/h more is produced than injected; is producer at -500.0'),
        ({'producer': -485.0}, '15 ml/h more is injected'),
        ({'control1': 750.0, 'producer': -1250.0}, 'control1 at 750.0 ml/h is above its limit'),
        (
            {'control1': 300.0, 'control2': 300.0, 'producer': -1100.0},
            'inject 600.0 ml/h together, more than 500 ml/h, max_total_rate_ml_h',
        ),
        ({'injector': 8.33, 'producer': -8.33}, 'injector runs at 500 ml/h all the time'),
    ],
)
def test_odd_rates_are_doubted(changed: dict[str, float], words: str) -> None:
    (doubt,) = doubts_about(SAFE | {well: rate(ml_h) for well, ml_h in changed.items()}, RIG)
    assert words in doubt


def test_more_than_the_producer_takes_is_doubted() -> None:
    assert RIG.control is not None
    control = RIG.control.model_copy(update={'max_producer_rate_ml_h': 600.0})
    rig = RIG.model_copy(update={'control': control})
    told = {**SAFE, 'control1': rate(100.0), 'producer': rate(-600.0)}
    assert doubts_about(told, rig) == []
    (doubt,) = doubts_about({**told, 'control1': rate(120.0), 'producer': rate(-620.0)}, rig)
    assert 'max_producer_rate_ml_h 600 leaves' in doubt
    (doubt,) = doubts_about({**SAFE, 'injector': rate(620.0), 'producer': rate(-620.0)}, rig)
    assert 'producer takes out 620.0 ml/h, more than its limit of 600 ml/h' in doubt


def test_pumps_that_are_as_exact_as_pumps_are_balance() -> None:
    assert doubts_about(SAFE, RIG) == []
    for ml_h in (-491.0, -499.0, -500.1):
        assert doubts_about({**SAFE, 'producer': rate(ml_h)}, RIG) == []


def test_rates_of_a_rig_with_open_sides_balance_only_with_a_producer() -> None:
    short = {**SAFE, 'producer': rate(-300.0)}
    assert imbalance(short, UNCONTROLLED) == ''
    assert imbalance(short, CLOSED.model_copy(update={'control': None}))
