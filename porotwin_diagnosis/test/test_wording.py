"""Effects and parameters in words and in units of the bench."""

from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.report.wording import CHECKS, PHRASES, interval, number, phrase, value


def test_every_effect_of_the_library_has_words_and_a_check(denser):
    for candidate in library(denser.samples):
        parameters = {
            name: {'value': amount}
            for name, amount in candidate.described(candidate.first).parameters.items()
        }
        assert phrase(candidate.effect, parameters)
        assert candidate.effect in CHECKS
    assert set(PHRASES) == set(CHECKS)


def test_parameters_are_read_in_units_of_the_bench():
    assert value('rate', 1e-5, '1/s') == '3.6 %/h'
    assert value('dx', -0.0051, 'm') == '−5.1 mm'
    assert number(1.4e-8, 2) == '1.4·10<sup>−8</sup>'
    assert number(1234.0, 2) == '1200'
    parameter = {'value': 0.0494, 'low': 0.0471, 'high': 0.0518, 'unit': 'm'}
    assert interval('radius', parameter) == ('49.4 mm', '47.1 … 51.8 mm')
    assert interval('well', {'value': 'a<b'}) == ('a&lt;b', '')


def test_directions_follow_the_sign():
    assert 'lighter' in phrase('buoyancy', {'density_difference': {'value': -0.4}})
    assert '18 s earlier' in phrase('clock', {'offset': {'value': -18.0}})
    lost = phrase('leak', {'x': {'value': 0.1}, 'z': {'value': 0.2}, 'rate': {'value': -20.0}})
    assert lost.startswith('water is lost at x = 0.100 m, z = 0.200 m: 20 ml/h')
