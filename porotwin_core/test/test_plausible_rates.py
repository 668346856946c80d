"""Tests of the greatest rates that are plausible for the pumps of a rig."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.plausible_rates import greatest_rate_ml_h, refuse_too_great
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig

SMALL_RIG = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


@pytest.mark.parametrize(
    ('well', 'rate_ml_h', 'complaint'),
    [('control1', 1e9, 'is not plausible'), ('ghost', 1.0, 'is not in the rig; known: ')],
)
def test_rates_beyond_the_pumps_are_refused(well: str, rate_ml_h: float, complaint: str) -> None:
    rig = load_rig(SMALL_RIG)
    with pytest.raises(InputError, match=complaint):
        refuse_too_great({well: WellRate(from_ml_h(rate_ml_h))}, rig)


def test_the_greatest_rate_itself_is_plausible() -> None:
    rig = load_rig(SMALL_RIG)
    most = 0.999 * greatest_rate_ml_h(rig)
    refuse_too_great({'control1': WellRate(from_ml_h(most))}, rig)
