"""Numbers, factors, directions and times in words."""

from porotwin_core.model.effect_parameter import Parameter, Reading
from porotwin_solver.effects.definition import words


def test_numbers_have_significant_digits_and_powers_of_ten() -> None:
    assert words.number(1.4e-8, 2) == '1.4·10⁻⁸'
    assert words.number(1234.0, 2) == '1200'
    assert words.number(99.7, 2) == '100'
    assert words.number(-0.5) == '−0.5'


def test_factors_are_per_cent_or_multiples() -> None:
    ways = ('more than', 'less than', 'as much as')
    assert words.factor(1.12, *ways) == '12 % more than'
    assert words.factor(0.9, *ways) == '10 % less than'
    assert words.factor(4.0, *ways) == '4 times as much as'
    assert words.factor(0.25, *ways) == '0.25 times as much as'
    assert words.factor(0.0, *ways) == '0 times as much as'


def test_directions_and_times() -> None:
    assert words.direction(-0.004, 'right', 'left') == '4 mm left'
    assert words.time_span(18.0) == '18 s'
    assert words.time_span(300.0) == '5 min'
    assert words.time_span(84000.0) == '23.3 h'
    assert words.time_span(864000.0) == '10 days'


def test_a_parameter_may_have_a_reading_of_its_own() -> None:
    assert words.reading(Parameter(unit='m')) == Reading(1e3, 'mm')
    assert words.reading(Parameter(unit='bar')) == Reading(1.0, 'bar')
    assert words.reading(Parameter(unit='1/s', reading=Reading(60.0, '1/min'))).unit == '1/min'
