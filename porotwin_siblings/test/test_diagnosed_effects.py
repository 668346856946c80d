"""Tests of the effects that a diagnosis found."""

import json
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import HALF_INTERVAL
from porotwin_siblings.diagnosed_effects import read_diagnosis

BUOYANCY = {
    'name': 'buoyancy',
    'parameters': {'density_difference': {'value': 4.0, 'low': 3.5, 'high': 4.5, 'unit': 'kg/m3'}},
}
RATE = {
    'name': 'rate',
    'parameters': {
        'well': {'value': 'injector', 'low': None, 'high': None, 'unit': 'name'},
        'factor': {'value': 0.9, 'low': 0.8, 'high': 1.0, 'unit': '-'},
    },
}


def written(folder: Path, effects: list[dict], combination: list[str]) -> Path:
    path = folder / 'diagnosis.json'
    path.write_text(json.dumps({'effects': effects, 'combination': combination}))
    return path


def test_kept_effects_are_read_with_their_intervals(tmp_path: Path) -> None:
    (found,) = read_diagnosis(written(tmp_path, [BUOYANCY, RATE], ['buoyancy']))
    assert found.effect == 'buoyancy'
    (number,) = found.parameters
    assert (number.name, number.value(0.0)) == ('density_difference', 4.0)
    assert number.step == pytest.approx(0.5 / HALF_INTERVAL)


def test_drawn_values_stay_within_what_an_effect_allows(tmp_path: Path) -> None:
    parameters = {'factor': RATE['parameters']['factor']}
    porosity = {'name': 'porosity', 'parameters': parameters}
    (found,) = read_diagnosis(written(tmp_path, [porosity], ['porosity']))
    assert found.described([-30.0]).parameters == {'factor': 1.0 / MOST_FACTOR}


@pytest.mark.parametrize('end', [None, 1e-9])
def test_a_number_without_an_interval_is_taken_as_it_is(tmp_path: Path, end: float | None) -> None:
    diffusion = {'value': 1e-9, 'low': end, 'high': end, 'unit': 'm2/s'}
    along = {'value': 9e-4, 'low': 6e-4, 'high': 1.2e-3, 'unit': 'm'}
    dispersion = {
        'name': 'dispersion',
        'parameters': {'diffusion': diffusion, 'longitudinal_dispersivity': along},
    }
    (found,) = read_diagnosis(written(tmp_path, [dispersion], ['dispersion']))
    (number,) = found.parameters
    assert number.name == 'longitudinal_dispersivity'
    assert found.described([number.scaled(8e-4)]).parameters == {
        'diffusion': 1e-9,
        'longitudinal_dispersivity': pytest.approx(8e-4),
    }


def test_a_number_that_is_known_to_a_factor_is_drawn_by_its_logarithm(tmp_path: Path) -> None:
    across = {'value': 7e-6, 'low': 1e-7, 'high': 0.1, 'unit': 'm'}
    dispersion = {'name': 'dispersion', 'parameters': {'transverse_dispersivity': across}}
    (found,) = read_diagnosis(written(tmp_path, [dispersion], ['dispersion']))
    (number,) = found.parameters
    assert number.value(0.0) == pytest.approx(7e-6)
    drawn = found.described([1.0]).parameters
    assert drawn['transverse_dispersivity'] == pytest.approx(7e-6 * 1e6 ** (0.5 / HALF_INTERVAL))


def test_effects_of_camera_scheme_and_pumps_are_none_of_the_siblings(tmp_path: Path) -> None:
    clock = {'name': 'clock', 'parameters': {'offset': {'value': 9.0, 'low': 8.0, 'high': 10.0}}}
    scheme = {
        'name': 'numerical_diffusion',
        'parameters': {'model_diffusion': {'value': 1e-8, 'low': 5e-9, 'high': 2e-8}},
    }
    named = ['buoyancy', 'clock', 'numerical_diffusion', 'rate']
    (found,) = read_diagnosis(written(tmp_path, [BUOYANCY, clock, scheme, RATE], named))
    assert found.effect == 'buoyancy'


def test_no_verdict_leaves_nothing(tmp_path: Path) -> None:
    assert read_diagnosis(written(tmp_path, [BUOYANCY], [])) == ()


def test_another_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'other.json'
    path.write_text('{}')
    with pytest.raises(InputError, match='no diagnosis'):
        read_diagnosis(path)
    with pytest.raises(InputError, match='name a diagnosis'):
        read_diagnosis(tmp_path / 'absent.json')
