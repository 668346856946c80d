"""Tests of the safe rates of a rig."""

from pathlib import Path

import pytest

from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import net_rate
from porotwin_core.rig import load_rig

RIG = load_rig(Path(__file__).parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')


def test_control_wells_are_off_and_the_producer_takes_out_what_is_injected() -> None:
    rates = safe_rates(RIG)
    assert list(rates) == list(RIG.wells)
    shown = {name: to_ml_h(rate.rate) for name, rate in rates.items()}
    assert shown == pytest.approx(
        {'injector': 500.0, 'producer': -500.0, 'control1': 0, 'control2': 0, 'control3': 0}
    )
    assert rates['injector'].concentration == 1.0
    assert net_rate(rates) == 0.0


def test_without_a_control_section_every_well_is_off() -> None:
    rates = safe_rates(RIG.model_copy(update={'control': None}))
    assert list(rates) == list(RIG.wells)
    assert all(rate.rate == 0.0 for rate in rates.values())
