"""Tests of rig.yaml: mistakes are refused by name, and a rig survives writing and reading."""

from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig, parse_rig, rig_from_maps, write_rig

SMALL: dict[str, Any] = {
    'name': 'small',
    'width_m': 0.934,
    'height_m': 0.562,
    'depth_m': 0.010,
    'porosity': 0.375,
    'permeability_m2': 6.57e-10,
    'viscosity_pa_s': 1.0e-3,
    'density_kg_m3': 998.0,
    'wells': {'injector': {'x_m': 0.235, 'z_m': 0.235}, 'producer': {'x_m': 0.66, 'z_m': 0.16}},
}
CONTROL: dict[str, Any] = {
    'wells': ['injector'],
    'producer': 'producer',
    'disallowed_zone_m': [[0, 0.4], [0.9, 0.4], [0.9, 0.5]],
}


def test_defaults_agree_with_the_experiment_folder_format() -> None:
    rig = parse_rig(SMALL, Path('rig.yaml'))
    assert rig.wells['injector'].radius_m == 0.004
    assert str(rig.default_grid()) == '187x112'
    hall = rig.model_copy(update={'width_m': 19.0, 'height_m': 18.0})
    assert str(hall.default_grid()) == '475x450'
    assert (rig.field('porosity', rig.grid(3, 2)) == 0.375).all()


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'name': 'two\nlines'}, 'write one line without control characters'),
        ({'porosty': 0.3}, "unknown key 'porosty'"),
        ({'width_cm': 60}, "write 'width_m'; 1 cm is 0.01 m"),
        ({'permeability_darcy': 5}, "write 'permeability_m2'; 1 darcy is 9.87e-13 m2"),
        (
            {'control': {'wells': ['a'], 'max_rate_ml_min': 5}},
            "write 'max_rate_ml_h'; 1 ml/min is 60 ml/h",
        ),
        (
            {'control': {'wells': ['a'], 'fixed': {'b': {'rate_ml_h': 5, 'concentration': 2}}}},
            'write a number less than or equal to 1 (concentration of the injected water: 0 water',
        ),
        ({'porosity': -0.1}, 'porosity = -0.1'),
        ({'porosity': 1.2}, 'porosity 1.2'),
        ({'depth_m': float('nan')}, 'depth_m'),
        ({'wells': {'far': {'x_m': 2.0, 'z_m': 0.1}}}, "'far'"),
        ({'wells': {'half': {'x_m': 0.2}}}, "'wells.half.z_m' is missing"),
        ({'boundaries': {'top': 'ajar'}}, 'boundaries.top'),
        ({'porosty': 0.3, 'widht_m': 1.0}, '(also wrong or missing: widht_m)'),
        (
            {'porosity': -0.1, 'boundaries': {'top': 'ajar'}},
            '(also wrong or missing: boundaries.top)',
        ),
        ({'permeability_m2': 1.2, 'depth_m': 40.0}, '(also impossible: permeability_m2)'),
        ({'control': {**CONTROL, 'wells': ['control9']}}, "unknown well 'control9'"),
        ({'control': {**CONTROL, 'wells': ['producer']}}, 'two roles'),
        ({'control': {**CONTROL, 'disallowed_zone_m': [[0, 0]]}}, 'three'),
        ({'control': {**CONTROL, 'objective': {'zone_m': []}}}, 'control.objective'),
        ({'control': {**CONTROL, 'objective': 7}}, 'control.objective'),
    ],
)
def test_a_mistake_is_named_on_one_line(change: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_rig({**SMALL, **change}, Path('rig.yaml'))
    assert named in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_missing_key_is_named_with_its_purpose() -> None:
    data = {key: value for key, value in SMALL.items() if key != 'width_m'}
    with pytest.raises(InputError, match="'width_m' is missing: width of the sand"):
        parse_rig(data, Path('rig.yaml'))


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no such file'):
        load_rig(tmp_path)
    (tmp_path / 'rig.yaml').write_text('name: [unclosed')
    with pytest.raises(InputError, match='not readable as YAML'):
        load_rig(tmp_path)
    (tmp_path / 'rig.yaml').write_text('[' * 5000)
    with pytest.raises(InputError, match='nested too deeply'):
        load_rig(tmp_path)
    (tmp_path / 'rig.yaml').write_text('name: small', encoding='utf-16')
    with pytest.raises(InputError, match='save it as UTF-8'):
        load_rig(tmp_path)
    (tmp_path / 'rig.yaml').write_text(
        yaml.safe_dump({**SMALL, 'depth_m': {'file': 'depth.nc', 'variable': 'depth'}})
    )
    with pytest.raises(InputError, match=r"'depth\.nc', which is not beside it"):
        load_rig(tmp_path)


def test_a_map_with_damaged_bytes_or_with_texts_is_named(tmp_path: Path) -> None:
    depth = {'file': 'depth.nc', 'variable': 'depth'}
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump({**SMALL, 'depth_m': depth}))
    file = tmp_path / 'depth.nc'
    with netCDF4.Dataset(file, 'w') as dataset:
        dataset.createDimension('z', 50)
        dataset.createDimension('x', 70)
        values = dataset.createVariable('depth', 'f8', ('z', 'x'), fletcher32=True)
        values[:] = np.random.default_rng(3).uniform(0.018, 0.028, (50, 70))
    whole = bytearray(file.read_bytes())
    whole[len(whole) // 2] ^= 255
    file.write_bytes(whole)
    with pytest.raises(InputError, match=r'depth\.nc: not a readable NetCDF file'):
        load_rig(tmp_path)
    with netCDF4.Dataset(file, 'w') as dataset:
        dataset.createDimension('z', 2)
        dataset.createDimension('x', 2)
        dataset.createVariable('depth', 'S1', ('z', 'x'))[:] = np.full((2, 2), b'a')
    with pytest.raises(InputError, match=r'depth\.nc: not a readable NetCDF file'):
        load_rig(tmp_path)


def test_a_rig_with_maps_survives_writing_and_reading(tmp_path: Path) -> None:
    depth = np.random.default_rng(3).uniform(0.018, 0.028, (5, 7))
    data = {
        key: value
        for key, value in SMALL.items()
        if key not in ('depth_m', 'porosity', 'permeability_m2')
    }
    rig = rig_from_maps(
        {**data, 'control': CONTROL},
        {'depth_m': depth, 'porosity': 0.4, 'permeability_m2': 1e-9},
    )
    write_rig(rig, tmp_path / 'rig.yaml')
    again = load_rig(tmp_path)
    assert again == rig
    np.testing.assert_array_equal(again.nominal_map('depth_m'), depth)


@pytest.mark.parametrize(
    ('objective', 'written'),
    [
        ('keep_in', 'keep_in'),
        ({'name': 'keep_in'}, 'keep_in'),
        (
            {'name': 'keep_in', 'zone_m': [[0, 0], [0.5, 0], [0.5, 0.5]], 'fuzziness_m': 0.05},
            {'name': 'keep_in', 'zone_m': [[0, 0], [0.5, 0], [0.5, 0.5]], 'fuzziness_m': 0.05},
        ),
    ],
)
def test_an_objective_survives_writing_and_reading(
    objective: object, written: object, tmp_path: Path
) -> None:
    control = {'wells': ['injector'], 'producer': 'producer', 'objective': objective}
    rig = parse_rig({**SMALL, 'control': control}, Path('rig.yaml'))
    assert rig.control is not None
    assert rig.control.objective.name == 'keep_in'
    write_rig(rig, tmp_path / 'rig.yaml')
    assert load_rig(tmp_path) == rig
    data = yaml.safe_load((tmp_path / 'rig.yaml').read_text())
    assert data['control']['objective'] == written


def test_the_default_objective_is_keep_out() -> None:
    rig = parse_rig({**SMALL, 'control': CONTROL}, Path('rig.yaml'))
    assert rig.control is not None
    assert (rig.control.objective.name, rig.control.objective.parameters) == ('keep_out', {})


def test_two_maps_of_one_file_both_survive_writing(tmp_path: Path) -> None:
    depth = np.random.default_rng(3).uniform(0.018, 0.028, (5, 7))
    porosity = np.random.default_rng(4).uniform(0.3, 0.5, (4, 6))
    reference = {'file': '../maps.nc'}
    with netCDF4.Dataset(tmp_path / 'maps.nc', 'w') as dataset:
        for name, values in (('depth', depth), ('porosity', porosity)):
            for axis, size in zip('zx', values.shape, strict=True):
                dataset.createDimension(f'{axis}_{name}', size)
            dataset.createVariable(name, 'f8', (f'z_{name}', f'x_{name}'))[:] = values
    data = {
        **SMALL,
        'depth_m': {**reference, 'variable': 'depth'},
        'porosity': {**reference, 'variable': 'porosity'},
    }
    (tmp_path / 'rigs').mkdir()
    rig = parse_rig(data, tmp_path / 'rigs' / 'rig.yaml')
    (tmp_path / 'copy').mkdir()
    write_rig(rig, tmp_path / 'copy' / 'rig.yaml')
    again = load_rig(tmp_path / 'copy')
    np.testing.assert_array_equal(again.nominal_map('depth_m'), depth)
    np.testing.assert_array_equal(again.nominal_map('porosity'), porosity)
    assert {file.name for file in (tmp_path / 'copy').iterdir()} == {
        'rig.yaml',
        'maps.nc',
        'porosity.nc',
    }


def test_maps_take_names_that_are_free(tmp_path: Path) -> None:
    reference = {'file': 'porosity.nc'}
    with netCDF4.Dataset(tmp_path / 'porosity.nc', 'w') as dataset:
        dataset.createDimension('z', 3)
        dataset.createDimension('x', 4)
        for name, value in (('depth', 0.02), ('porosity', 0.4)):
            dataset.createVariable(name, 'f8', ('z', 'x'))[:] = value
    data = {
        **SMALL,
        'depth_m': {**reference, 'variable': 'depth'},
        'porosity': {**reference, 'variable': 'porosity'},
    }
    rig = parse_rig(data, tmp_path / 'rig.yaml')
    copy = tmp_path / 'copy'
    copy.mkdir()
    write_rig(rig, copy / 'rig.yaml', is_taken=lambda name: name == 'depth_m.nc')
    assert load_rig(copy).nominal_maps.keys() == rig.nominal_maps.keys()
    assert np.unique(load_rig(copy).nominal_map('depth_m')) == [0.02]
    names = {file.name for file in copy.iterdir()}
    assert names == {'rig.yaml', 'porosity.nc', 'porosity_2.nc'}


@pytest.mark.parametrize(
    ('change', 'same'),
    [
        ({'name': 'other', 'control': CONTROL}, True),
        ({'porosity': 0.376}, False),
        ({'boundaries': {'top': 'closed'}}, False),
        ({'effects': [{'name': 'rate', 'parameters': {'well': 'injector', 'factor': 0.9}}]}, False),
        ({'wells': {**SMALL['wells'], 'injector': {'x_m': 0.24, 'z_m': 0.235}}}, False),
    ],
)
def test_the_fingerprint_depends_on_the_physics_alone(change: dict[str, Any], same: bool) -> None:
    first, second = (parse_rig(data, Path('rig.yaml')) for data in (SMALL, SMALL | change))
    assert (first.physics_fingerprint == second.physics_fingerprint) is same


def test_the_fingerprint_of_a_map_depends_on_its_numbers_alone(tmp_path: Path) -> None:
    data = {key: SMALL[key] for key in SMALL if key not in ('porosity', 'permeability_m2')}
    maps = [np.full((3, 4), 0.3), np.full((3, 4), 0.3), np.full((3, 4), 0.31)]
    rigs = [rig_from_maps(data, {'porosity': m, 'permeability_m2': 1e-9}) for m in maps]
    first, same, other = (rig.physics_fingerprint for rig in rigs)
    assert first == same != other
    write_rig(rigs[0], tmp_path / 'rig.yaml')
    assert load_rig(tmp_path).physics_fingerprint == first


@pytest.mark.parametrize('name', ['', ' ', 'a\nb', 'a\u202eb', 'a\u3164'])
def test_names_of_wells_fit_in_a_line(name: str) -> None:
    with pytest.raises(InputError, match='its name cannot be printed in a line; rename it'):
        parse_rig(SMALL | {'wells': {**SMALL['wells'], name: {'x_m': 0.3, 'z_m': 0.3}}}, Path('r'))


def test_keys_that_differ_are_named() -> None:
    first = parse_rig(SMALL, Path('rig.yaml'))
    second = parse_rig(SMALL | {'name': 'other', 'porosity': 0.376}, Path('rig.yaml'))
    assert first.keys_that_differ(second) == ['porosity']
    plain = {key: SMALL[key] for key in SMALL if key != 'porosity'}
    one, same, other = (
        rig_from_maps(plain, {'porosity': np.full((3, 4), value)}) for value in (0.3, 0.3, 0.31)
    )
    assert one.keys_that_differ(same) == []
    assert one.keys_that_differ(other) == ['porosity']


def test_sands_do_not_differ_from_their_drawn_maps() -> None:
    sand = {'porosity': 0.4, 'permeability_m2': 1e-9}
    plain = {key: SMALL[key] for key in SMALL if key not in sand}
    places = {'sands': {'coarse': sand}, 'sand_layers': [{'sand': 'coarse'}]}
    drawn = parse_rig(plain | places, Path('rig.yaml'))
    again = rig_from_maps(plain, drawn.nominal_maps)
    assert drawn.keys_that_differ(again) == again.keys_that_differ(drawn) == []
    thinner = again.model_copy(update={'depth_m': 0.014})
    assert drawn.keys_that_differ(thinner) == ['depth_m']


def test_a_polygon_with_more_corners_than_a_person_draws_is_refused() -> None:
    zone = [[0.5 + 0.001 * i, 0.4] for i in range(1000)] + [[0.5, 0.5]]
    control = {**CONTROL, 'disallowed_zone_m': zone}
    with pytest.raises(InputError, match='has 1001 points; leave out'):
        parse_rig({**SMALL, 'control': control}, Path('rig.yaml'))


@pytest.mark.parametrize('size', ['width_m', 'height_m'])
@pytest.mark.parametrize('metres', [1e12, 1e308])
@pytest.mark.parametrize(
    'part',
    [
        {'sands': {'fine': {'porosity': 0.4, 'permeability_m2': 1e-9}},
         'sand_layers': [{'sand': 'fine'}]},
        {'depth_m': {'points': [[0.1, 0.1, 0.01], [0.5, 0.1, 0.01], [0.5, 0.4, 0.01]]}},
        {'control': CONTROL},
    ],
)  # fmt: skip
def test_a_rig_as_large_as_a_typing_error_is_refused(size, metres, part) -> None:
    data = {key: value for key, value in SMALL.items() if 'sands' not in part or key not in
            ('porosity', 'permeability_m2')}  # fmt: skip
    with pytest.raises(InputError, match=f'{size} is 1e\\+'):
        parse_rig({**data, **part, size: metres}, Path('rig.yaml'))
