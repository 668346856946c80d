"""Tests of the rule of a parameter: the same words wherever a value comes from."""

import math
import re

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.parameter_rule import ParameterRule

HORIZON = ParameterRule('horizon_s', 600.0, 'look-ahead [s]', at_least=1.0, at_most=86400.0)
COUNT = ParameterRule('count', 3, 'a number', at_least=1)
PRESET = ParameterRule('preset', 'fast', 'scheme', choices=('fast', 'upwind'))
SPEAK = ParameterRule('speak', False, 'speak', changeable=True)


@pytest.mark.parametrize(
    ('rule', 'value', 'complaint'),
    [
        (HORIZON, -5.0, "'horizon_s' of hub is -5; it must be from 1 to 86400"),
        (HORIZON, math.nan, "'horizon_s' of hub is nan; it must be from 1 to 86400"),
        (HORIZON, 'long', "'horizon_s' of hub is 'long'; give a number"),
        (HORIZON, True, "'horizon_s' of hub is True; give a number"),
        (HORIZON, None, "'horizon_s' of hub is None; give a number"),
        (HORIZON, [600.0], "'horizon_s' of hub is [600.0]; give a number"),
        (COUNT, 0, "'count' of hub is 0; it must be at least 1"),
        (COUNT, 2.0, "'count' of hub is 2.0; give a whole number"),
        (COUNT, 2**63, "'count' of hub is 9223372036854775808: too large for ROS 2"),
        (PRESET, 'quick', "'preset' of hub is 'quick'; choose one of: fast, upwind"),
        (PRESET, 7, "'preset' of hub is 7; give text"),
        (SPEAK, 1, "'speak' of hub is 1; give true or false"),
    ],
)
def test_a_wrong_value_is_refused_in_one_line(
    rule: ParameterRule, value: object, complaint: str
) -> None:
    with pytest.raises(InputError, match=re.escape(complaint)):
        rule.taken(value, 'hub')


@pytest.mark.parametrize(
    ('rule', 'value'), [(HORIZON, 30), (COUNT, 7), (PRESET, 'upwind'), (SPEAK, True)]
)
def test_a_right_value_gets_the_type_of_the_parameter(rule: ParameterRule, value: object) -> None:
    taken = rule.taken(value, 'hub')
    assert taken == value
    assert type(taken) is type(rule.default)


@pytest.mark.parametrize('rule', [HORIZON, COUNT, PRESET, SPEAK], ids=lambda rule: rule.name)
def test_a_rule_survives_its_json(rule: ParameterRule) -> None:
    assert ParameterRule.from_json(rule.name, rule.as_json()) == rule
