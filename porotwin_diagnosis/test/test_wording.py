"""Parameters of effects in the units of a report, and effects in words."""

from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.report.wording import interval, phrase, spoken_label, value
from porotwin_solver.effects import EFFECTS


def test_parameters_are_stated_in_units_of_the_laboratory():
    assert value('decay', 'rate', 1e-5) == '3.6 %/h'
    assert value('well_position', 'dx', -0.0051) == '−5.1 mm'
    assert value('dual_porosity', 'exchange_rate', 1e-3) == '3.6 per hour'
    assert value('leak', 'rate', 12.0) == '12 ml/h'


def test_a_signal_that_would_be_gone_within_an_hour_changes_by_the_minute():
    told = {'drift': {'value': -1.69 / 3600.0}, 'gradient': {'value': 0.0}}
    assert '2.83 %/min' in phrase('illumination', told)
    slow = {**told, 'drift': {'value': 0.16 / 3600.0}}
    assert '16 %/h' in phrase('illumination', slow)


def test_an_interval_is_written_to_two_digits_of_its_width():
    entry = {'value': 0.0494, 'low': 0.0471, 'high': 0.0518, 'unit': 'm'}
    assert interval('heterogeneity', 'radius', entry) == ('49.4 mm', '47.1 … 51.8 mm')
    turned = {'value': -0.0004, 'low': -0.03, 'high': 0.03}
    assert interval('registration', 'rotation', turned)[0].startswith('0.0')
    assert interval('rate', 'well', {'value': 'a<b'}) == ('a<b', '')


def test_the_sentence_and_the_table_state_the_same_number():
    place = {'x': {'value': 1.2341, 'low': 1.1, 'high': 1.3}, 'z': {'value': 0.2}}
    for low, high in ((880.0, 912.0), (893.42, 898.31), (600, 1200)):
        rate = {'value': 896.4, 'low': low, 'high': high}
        assert interval('leak', 'rate', rate)[0] == '896 ml/h'
        assert phrase('leak', {**place, 'rate': rate}).endswith('m: 896 ml/h')
    assert interval('leak', 'x', place['x']) == ('1234 mm', '1100 … 1300 mm')
    large = {'value': 1234.0, 'low': 1218.0, 'high': 1250.0}
    assert interval('leak', 'rate', large) == ('1230 ml/h', '1220 … 1250 ml/h')


def test_a_strong_factor_is_the_number_of_its_interval():
    zone = {name: {'value': 0.1} for name in ('x', 'z', 'radius')}
    tight = {'value': 0.1203, 'low': 0.04, 'high': 0.37}
    assert interval('heterogeneity', 'permeability_factor', tight) == ('0.12', '0.04 … 0.37')
    words = phrase('heterogeneity', {**zone, 'permeability_factor': tight})
    assert words.endswith('is 0.12 times as permeable as the nominal sand')


def test_directions_follow_the_sign():
    assert 'lighter' in phrase('buoyancy', {'density_difference': {'value': -0.4}})
    assert '18 s ahead of' in phrase('clock', {'offset': {'value': -18.0}})
    lost = phrase('leak', {'x': {'value': 0.1}, 'z': {'value': 0.2}, 'rate': {'value': -20.0}})
    assert lost.startswith('water is lost at x = 0.100 m, z = 0.200 m: 20 ml/h')


def test_a_size_whose_interval_holds_no_effect_is_doubted():
    flow = {
        'x_velocity': {'value': 1e-7, 'low': -1e-7, 'high': 3e-7},
        'z_velocity': {'value': 1e-6, 'low': 8e-7, 'high': 1.2e-6},
    }
    assert phrase('background_flow', flow).endswith('(perhaps x velocity 0)')
    flow['x_velocity']['low'] = 1e-8
    assert 'perhaps' not in phrase('background_flow', flow)


def test_every_effect_of_the_library_has_words_and_a_check(denser):
    for candidate in library(denser.samples):
        parameters = {
            name: {'value': amount}
            for name, amount in candidate.described(candidate.first).parameters.items()
        }
        assert phrase(candidate.effect, parameters)
        assert EFFECTS[candidate.effect].laboratory_check


def test_a_label_in_words_keeps_the_names_of_wells():
    assert spoken_label('rate water_in + dual_porosity') == 'wrong rate of water_in + dual porosity'
    assert spoken_label('dispersion diffusion') == 'dispersion (diffusion)'
    assert spoken_label('rate a<b, swinging') == 'wrong rate of a<b, swinging'
    assert spoken_label('lagging signal') == 'lagging signal'


def test_a_parameter_without_an_interval_has_two_digits():
    small = {'dx': {'value': 1.29e-5}, 'dz': {'value': 1.32e-4}, 'well': {'value': 'left'}}
    words = phrase('well_position', small)
    assert '0.013 mm' in words
    assert '0.13 mm' in words
    assert 'is 12 % higher' in phrase('porosity', {'factor': {'value': 1.1234}})
    assert ' 3.1 % more' in phrase('viscosity', {'viscosity_ratio': {'value': 1.0312}})
    assert '47 %' in phrase('rate', {'well': {'value': 'left'}, 'factor': {'value': 0.474}})
