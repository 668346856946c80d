"""Parameters of effects: ranges, defaults, refusals."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_parameter import (
    ONSET,
    Parameter,
    Reading,
    checked_values,
    lasting,
    onset,
)
from porotwin_core.rig import EffectDescription

PARAMETERS = {
    'well': Parameter(unit='name', is_name=True),
    'factor': Parameter(unit='-', above=0.0, high=5.0, neutral=1.0),
    'delay': Parameter(unit='s', low=0.0, default=3.0),
}


def test_missing_parameters_take_their_default() -> None:
    values = checked_values('slow', PARAMETERS, {'well': 'a', 'factor': '0.5'})
    assert values == {'well': 'a', 'factor': 0.5, 'delay': 3.0}


@pytest.mark.parametrize(
    ('given', 'complaint'),
    [
        ({'speed': 1.0}, "effect slow: unknown parameter 'speed'; known: well, factor, delay"),
        ({'well': 'a'}, r"effect slow: parameter 'factor' \[-\] is missing"),
        ({'well': 1.0, 'factor': 1.0}, 'effect slow: well = 1.0: give a name'),
        ({'well': 'a', 'factor': 'big'}, "factor = 'big': give a number"),
        ({'well': 'a', 'factor': float('nan')}, 'factor = nan: give a number'),
        ({'well': 'a', 'factor': 0.0}, 'factor = 0: must be greater than 0'),
        ({'well': 'a', 'factor': 6.0}, 'factor = 6: must be at most 5'),
        ({'well': 'a', 'factor': 1.0, 'delay': -1.0}, 'delay = -1: must be at least 0'),
    ],
)
def test_wrong_parameters_are_refused_by_name_value_and_remedy(given, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        checked_values('slow', PARAMETERS, given)


def test_a_factor_has_no_unit_and_is_neutral_at_one() -> None:
    assert PARAMETERS['factor'].is_factor
    assert not PARAMETERS['delay'].is_factor
    assert not Parameter(unit='-', neutral=1.0, reading=Reading(1.0, '')).is_factor


def test_an_effect_lasts_without_its_onset() -> None:
    worn = {'well': 'a', 'factor': 0.7}
    late = EffectDescription(name='rate', parameters={**worn, 'since': 600.0})
    assert onset(late) == 600.0
    assert lasting(late) == EffectDescription(name='rate', parameters=worn)
    assert onset(lasting(late)) == 0.0
    assert checked_values('rate', {'since': ONSET}, {}) == {'since': 0.0}
