"""./porotwin check."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import yaml
from cli_examples import porotwin
from typer.testing import CliRunner

from porotwin_checks.checks.injected_volume import injected
from porotwin_cli.app import app
from porotwin_cli.checking.rig_check import (
    CheckedRig,
    balance_of,
    barriers_in_words,
    check,
    effects_in_words,
    heads_in_words,
    in_words,
    levels_in_words,
    maps_in_words,
    recorded_interval,
)
from porotwin_cli.pictures.check_picture import check_picture, shading, well_roles
from porotwin_cli.workspace import ROOT, small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY, to_ml_h
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Boundaries, EffectDescription, Rig, load_rig
from porotwin_core.rig.sections import LevelCourse, WaterTable
from porotwin_imaging.baseline.corner_check import KEY
from porotwin_recording.experiment.experiment_folder import folder_data, write_folder
from porotwin_recording.tables.concentration import (
    ConcentrationMaps,
    ConcentrationWriter,
    open_maps,
)
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData

pytestmark = pytest.mark.usefixtures('undrawn')

BETWEEN = {
    'top': 'closed',
    'left': 'open',
    'right': 'open',
    'heads_m': {'left': 0.32, 'right': 0.31},
}
"""Water flows below a head that falls by 1 cm."""


def changed(folder: Path, **keys: object) -> Path:
    """Write the small rig with other values of some keys."""
    data = yaml.safe_load(small_rig().read_text()) | keys
    (folder / 'rig.yaml').write_text(yaml.safe_dump(data))
    return folder / 'rig.yaml'


def told(path: Path) -> str:
    """Return all remarks about `path` as one text."""
    return '\n'.join(map(str, check(path).remarks))


def test_the_small_rig_is_drawn_and_not_odd(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()  # this one is drawn
    result = porotwin('check', small_rig(), '--output', tmp_path / 'check.png')
    assert result.returncode == 0, result.stderr
    assert 'one prediction over 30 s on 187x112: 20,944 cells' in result.stdout
    assert 'nothing odd' in result.stdout
    assert (tmp_path / 'check.png').read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize(
    ('maps', 'columns', 'rows', 'told'),
    [
        (8, 60, 40, '; below 80 cells along the longer side of the rig a diagnosis states at '),
        (8, 80, 40, ''),
        (7, 80, 40, '; a diagnosis needs 8 maps'),
        (8, 3, 3, '; a diagnosis needs 4 columns and rows'),
    ],
)
def test_maps_that_limit_a_diagnosis_are_told(
    maps: int, columns: int, rows: int, told: str
) -> None:
    words = maps_in_words(np.arange(maps) * 60.0, Grid(columns, rows, 1.0, 0.5))
    facts = f'maps: {maps}, from 0 to {60 * maps - 60} s, on {columns}x{rows}'
    assert words.startswith(facts + told)
    assert (words == facts) is (not told)


def test_what_is_impossible_is_listed_with_status_2(tmp_path: Path) -> None:
    rig = changed(tmp_path, permeability_m2=665.0, depth_m=10.0, porosity=0.15)
    picture = str(tmp_path / 'check.png')
    result = CliRunner().invoke(app, ['check', str(rig), '--json', '--output', picture])
    assert result.exit_code == 2
    answer = json.loads(result.stdout)
    assert answer['runs'] is False
    assert answer['cost'] is None
    refused = {remark['key'] for remark in answer['remarks'] if remark['refused']}
    assert refused == {'depth_m', 'permeability_m2'}
    assert set(answer['remarks'][0]) == {
        'key',
        'value',
        'why',
        'remedy',
        'refused',
        'code',
        'facts',
    }
    assert Path(picture).is_file()


def test_what_is_odd_is_listed_with_status_0(tmp_path: Path) -> None:
    checked = check(changed(tmp_path, porosity=0.15), grid='187x30')
    assert checked.runs
    assert [remark.key for remark in checked.remarks] == ['porosity', 'grid']
    assert checked.cost is not None


@pytest.mark.parametrize(
    ('keys', 'named'),
    [
        ({'effects': [{'name': 'magic', 'parameters': {}}]}, "'magic'"),
        ({'control': {'wells': ['control1'], 'producer': 'producer'}}, 'disallowed_zone_m'),
    ],
)
def test_the_users_of_a_rig_are_asked(keys: dict[str, object], named: str, tmp_path: Path) -> None:
    assert named in told(changed(tmp_path, **keys))


def test_an_effect_of_the_camera_is_odd_and_one_of_the_rig_is_not(tmp_path: Path) -> None:
    light = {'name': 'illumination', 'parameters': {'drift': -1e-5}}
    decay = {'name': 'decay', 'parameters': {'rate': 1e-5}}
    checked = check(changed(tmp_path, effects=[decay, light]))
    assert checked.runs
    (remark,) = checked.remarks
    assert str(remark).startswith('effects.2 is illumination: simulations show this effect')


def test_tracer_that_is_injected_into_the_unwanted_zone_is_odd(tmp_path: Path) -> None:
    control = yaml.safe_load(small_rig().read_text())['control']
    whole = [[0.01, 0.01], [0.9, 0.01], [0.9, 0.5], [0.01, 0.5]]
    path = changed(tmp_path, control=control | {'disallowed_zone_m': whole})
    assert 'well injector injects tracer where it wants none' in told(path)


def test_a_bottle_that_the_plan_empties_is_odd(tmp_path: Path) -> None:
    control = yaml.safe_load(small_rig().read_text())['control'] | {'end_min': 60}
    needed = control['fixed']['injector']['rate_ml_h']
    assert 'control.stock_ml' not in told(changed(tmp_path, control=control | {'stock_ml': needed}))
    few = told(changed(tmp_path, control=control | {'stock_ml': needed / 2}))
    assert 'the bottle is empty at 1800 s, before the end at 3600 s' in few


def test_the_effects_of_the_model_are_told(tmp_path: Path) -> None:
    leak = {'name': 'leak', 'parameters': {'x': 0.4, 'z': 0.2, 'rate': -12.0}}
    checked = check(changed(tmp_path, effects=[leak]))
    assert effects_in_words(checked.effects) == [
        'the model has these effects: leak: water is lost at x = 0.400 m, z = 0.200 m: 12 ml/h'
    ]
    assert effects_in_words(check(small_rig()).effects) == []


def test_sands_that_conduct_like_clay_are_told(tmp_path: Path) -> None:
    data = yaml.safe_load((ROOT / 'rigs' / 'two_sands' / 'rig.yaml').read_text())
    assert barriers_in_words(load_rig(ROOT / 'rigs' / 'two_sands')) == []
    data['sands']['fine'] = {'porosity': 0.4, 'permeability_m2': 5e-15}
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump(data))
    (line,) = barriers_in_words(load_rig(tmp_path))
    assert line.startswith('barriers: fine (5e-15 m2); this is right for clay. ')
    assert line in in_words(check(tmp_path))


def test_parameters_without_a_value_are_told_with_their_default() -> None:
    effects = [
        EffectDescription(name='registration', parameters={'dx': 0.01}),
        EffectDescription(name='background_flow', parameters={'x_velocity': 1e-5}),
    ]
    (line,) = effects_in_words(effects)
    assert 'shifted 10 mm right and 0 mm up' in line
    assert '36 mm/h right and 0 mm/h up' in line


def test_the_rate_between_two_heads_counts_the_effects() -> None:
    sides = {'top': 'closed', 'left': 'open', 'right': 'open'}
    heads = Boundaries.model_validate({**sides, 'heads_m': {'left': 0.62, 'right': 0.6}})
    rig = load_rig(small_rig()).model_copy(update={'boundaries': heads})
    darcy = 6.57e-10 * 998.0 * GRAVITY / 1e-3 * 0.010 * 0.562 * 0.02 / 0.934
    minutes = rig.pore_volume / darcy / 60.0
    told = heads_in_words(rig, rig.grid(40, 24))
    assert told.startswith(f'heads: {to_ml_h(darcy):.4g} ml/h flow')
    assert "from 'left' to 'right'" in told  # two heads may have been exchanged
    assert told.endswith(f'in {minutes:.3g} min')
    loose = rig.with_effects([EffectDescription(name='porosity', parameters={'factor': 0.5})])
    assert heads_in_words(loose, rig.grid(40, 24)).endswith(f'in {0.5 * minutes:.3g} min')


def test_below_a_table_only_the_wet_pores_are_exchanged() -> None:
    sides = {'top': 'closed', 'left': 'open', 'right': 'open'}
    heads = Boundaries.model_validate({**sides, 'heads_m': {'left': 0.30, 'right': 0.28}})
    update = {'boundaries': heads, 'water_table': WaterTable(fringe_m=0.0)}
    rig = load_rig(small_rig()).model_copy(update=update)
    dupuit = 6.57e-10 * 998.0 * GRAVITY / 1e-3 * 0.010 * (0.30**2 - 0.28**2) / (2.0 * 0.934)
    wet = 0.375 * 0.010 * 0.934 * 0.29  # the mean height of the table
    told = heads_in_words(rig, rig.grid(80, 48))
    minutes = float(told.removesuffix(' min').split()[-1])
    assert minutes == pytest.approx(wet / dupuit / 60.0, rel=0.03)


@pytest.mark.parametrize(
    ('effect', 'complaint'),
    [
        ({'name': 'porosity', 'parameters': {'facter': 1.1}}, "unknown parameter 'facter'"),
        ({'name': 'porosity'}, 'factor'),
        ({'name': 'leak', 'parameters': {'x': 'here', 'z': 0.2, 'rate': 'twenty'}}, 'x'),
    ],
)
def test_a_wrong_effect_is_named(tmp_path: Path, effect: dict, complaint: str) -> None:
    checked = check(changed(tmp_path, effects=[effect]))
    assert not checked.runs
    assert complaint in str(checked.remarks[0])
    assert in_words(checked)
    check_picture(tmp_path / 'check.png', checked)


def test_an_impossible_grid_is_named() -> None:
    checked = check(small_rig(), grid='100000x5')
    assert not checked.runs
    assert '0.00934 mm x 112 mm' in str(checked.remarks[0])


def test_an_experiment_is_checked_with_its_photographs(experiment: Path, tmp_path: Path) -> None:
    checked = check(experiment)
    assert (checked.kind, checked.remarks) == ('experiment folder', ())
    assert checked.photograph is not None
    picture = str(tmp_path / 'check.png')
    result = CliRunner().invoke(app, ['check', str(experiment), '--output', picture])
    assert result.exit_code == 0, result.output


def test_a_corner_off_the_sand_is_told_with_its_place(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    data = yaml.safe_load((folder / 'rig.yaml').read_text())
    column, row = data['camera']['corners_px'][2]
    data['camera']['corners_px'][2] = [column - 18, row]
    (folder / 'rig.yaml').write_text(yaml.safe_dump(data))
    remarks = check(folder).remarks
    assert len(remarks) == 1
    assert 'lower right near [' in str(remarks[0])
    assert re.search(r'\b1[789] px from the given one', str(remarks[0]))


def test_mistakes_of_an_experiment_are_all_listed(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    data = yaml.safe_load((folder / 'rig.yaml').read_text())
    data['camera']['corners_px'] = [[4 * c, 4 * r] for c, r in data['camera']['corners_px']]
    (folder / 'rig.yaml').write_text(yaml.safe_dump(data))
    assert {one.key for one in check(folder).remarks if one.refused} == {KEY}
    (folder / 'rates.csv').write_text('time_s;well;rate_ml_h;concentration\n')
    assert 'it uses semicolons' in told(folder)


def test_rates_off_the_told_steps_of_the_pump_are_odd(tmp_path: Path) -> None:
    control = yaml.safe_load(small_rig().read_text())['control']
    rig = changed(tmp_path, control={**control, 'rate_step_ml_h': 0.5})
    (tmp_path / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n0,control1,107.37,0\n0,producer,-107.37,0\n'
        '60,control1,110,0\n60,producer,-110,0\n90,control1,3.55,0\n90,producer,-3.55,0\n'
    )
    remarks = told(rig.parent)
    assert 'rates.csv at 0 s is control1 107.37 ml/h: no multiple of control.rate_step' in remarks
    assert 'like 1 more' in remarks
    assert check(rig.parent).runs
    assert 'no multiple' not in told(changed(tmp_path).parent), 'nobody told the default'


def test_a_file_of_another_kind_is_told_from_a_wrong_rig(tmp_path: Path) -> None:
    (tmp_path / 'model.nc').write_bytes(b'CDF\x01\xff')
    with pytest.raises(InputError, match=r'model\.nc: check reads .* import .* measure'):
        check(tmp_path / 'model.nc')
    (tmp_path / 'rig.yaml').write_bytes(b'CDF\x01\xff')
    with pytest.raises(InputError, match=r'rig\.yaml: not a text in UTF-8'):
        check(tmp_path / 'rig.yaml')


def test_a_bag_is_checked() -> None:
    checked = check(ROOT / 'bags' / 'sample')
    assert checked.kind == 'bag'
    assert checked.runs


def pumped(folder: Path, rates: str, **keys: object) -> CheckedRig:
    """Return the check of the small rig with these rates of injector and producer [ml/h]."""
    injected, produced = rates.split()
    changed(folder, **keys)
    (folder / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n'
        f'0,injector,{injected},1\n0,producer,-{produced},\n'
        '1800,injector,0,0\n1800,producer,0,\n'
    )
    return check(folder)


def test_rates_that_a_closed_rig_cannot_have_are_impossible(tmp_path: Path) -> None:
    closed = {'boundaries': {'top': 'closed'}}
    assert pumped(tmp_path, '500 500', **closed).runs
    checked = pumped(tmp_path, '800 500', **closed)
    assert not checked.runs
    assert checked.remarks[0].code == 'unbalanced_rates'
    assert checked.remarks[0].facts['sum_ml_h'] == pytest.approx(300.0)
    assert pumped(tmp_path, '800 500').runs


def test_a_pump_that_fails_while_it_rests_leaves_the_water_balance(tmp_path: Path) -> None:
    values = {'well': 'producer', 'factor': 0.0, 'since': 1500.0}
    late = [{'name': 'rate', 'parameters': values}]
    assert not pumped(tmp_path, '500 500', boundaries={'top': 'closed'}, effects=late).runs
    file = tmp_path / 'rates.csv'
    rows = file.read_text()
    file.write_text(rows.replace('1800,', '900,') + '1800,injector,0,0\n')
    checked = check(tmp_path)
    assert checked.runs
    assert balance_of(checked) is not None


def test_all_volumes_are_those_that_reach_the_sand(tmp_path: Path) -> None:
    weak = [{'name': 'rate', 'parameters': {'well': 'injector', 'factor': 0.5}}]
    lines = in_words(pumped(tmp_path, '600 600', effects=weak))
    assert any('150 ml of stock' in line for line in lines)
    assert any('injector +150 ml, producer -300 ml' in line for line in lines)
    (tmp_path / 'rates.csv').unlink()
    fixed = {'injector': {'rate_ml_h': 600.0, 'concentration': 1.0}}
    base = yaml.safe_load((tmp_path / 'rig.yaml').read_text())
    changed(tmp_path, effects=weak, control={**base['control'], 'fixed': fixed, 'end_min': 30})
    lines = in_words(check(tmp_path))
    assert any('150 ml of stock' in line for line in lines)
    assert any('injector +150 ml' in line for line in lines)


def test_a_leak_that_no_well_of_a_closed_rig_balances_is_impossible(tmp_path: Path) -> None:
    leak = [{'name': 'leak', 'parameters': {'x': 0.4, 'z': 0.2, 'rate': -50.0}}]
    checked = pumped(tmp_path, '500 500', boundaries={'top': 'closed'}, effects=leak)
    assert not checked.runs
    assert checked.remarks[0].facts['effects'] == 'leak'
    assert pumped(tmp_path, '500 500', effects=leak).runs


def test_an_effect_that_begins_after_the_end_is_odd_and_moves_no_water(tmp_path: Path) -> None:
    values = {'well': 'injector', 'factor': 2.0, 'since': 1e7}
    late = [{'name': 'rate', 'parameters': values}]
    checked = pumped(tmp_path, '500 500', effects=late)
    assert [remark.key for remark in checked.remarks] == ['effects.1']
    assert '+500.0' in str(balance_of(checked))
    values['since'] = 900.0
    checked = pumped(tmp_path, '500 500', effects=late)
    assert not checked.remarks
    assert '+1000.0' in str(balance_of(checked))


def test_water_without_a_steady_table_is_told_beside_dry_wells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise InputError('no steady table found; correct the heads')

    monkeypatch.setattr('porotwin_cli.checking.rig_check.TableFlow', refuse)
    keys = {'top': 'closed', 'left': 'open', 'right': 'open', 'heads_m': {'left': 0.0, 'right': 0}}
    changed(tmp_path, boundaries=keys, water_table={'fringe_m': 0.0})
    checked = check(tmp_path / 'rig.yaml')
    assert not checked.runs
    assert {'water', 'wells.injector'} <= {remark.key for remark in checked.remarks}


def test_one_extreme_sand_does_not_make_the_others_alike() -> None:
    sands = np.array([1e-14, 1e-10, 8e-10, 2e-9, 4e-9])
    shades = shading(sands)(sands)
    np.testing.assert_allclose(np.diff(shades), np.ptp(shades) / 4, rtol=0.02)
    many = np.append(np.geomspace(1e-10, 4e-9, 99), 1e-14)
    assert np.diff(shading(many)(np.array([1e-10, 4e-9]))) > 0.9 * np.ptp(shades)


def test_fluid_and_stock_are_told_apart(tmp_path: Path) -> None:
    data = pumped(tmp_path, '500 500').data
    assert data is not None
    found = injected(data.known())
    assert (found.volume, found.stock, found.end) == pytest.approx((250e-6, 250e-6, 1800.0))
    rates = (tmp_path / 'rates.csv').read_text()
    (tmp_path / 'rates.csv').write_text(rates.replace('500,1', '500,0.4'))
    words = '\n'.join(in_words(check(tmp_path)))
    assert 'injected: 250 ml of fluid, 100 ml of stock, until 1800 s' in words
    assert ', 1 time step' in words


def test_the_injected_stock_is_that_of_the_rates_that_drive_the_model(tmp_path: Path) -> None:
    data = pumped(tmp_path, '500 500').data
    assert data is not None
    assert data.commanded is not None
    half = [replace(row.rate, rate=row.rate.rate / 2) for row in data.commanded.rows]
    rows = zip(data.commanded.rows, half, strict=True)
    measured = Schedule(tuple(replace(row, rate=rate) for row, rate in rows))
    assert injected(replace(data, measured=measured).known()).stock == pytest.approx(125e-6)


def test_wells_of_a_recording_are_told_by_what_they_do(tmp_path: Path) -> None:
    checked = pumped(tmp_path, '500 500')
    rig = checked.rig.model_copy(update={'control': None})
    assert checked.data is not None
    roles = well_roles(replace(checked, rig=rig))
    assert (roles['injector'], roles['producer']) == ('injects stock', 'takes out')
    assert well_roles(replace(checked, rig=rig, data=None))['producer'] == 'other'


def photo(time: float, role: str = 'state') -> Photo:
    return Photo(time, role, f'{time:g}.jpg', bytes)


def test_the_cost_is_for_the_interval_of_the_recording(tmp_path: Path) -> None:
    folder, rig = tmp_path / 'slow', check(small_rig()).rig
    write_folder(folder, RecordedData(rig, maps=stored_maps(tmp_path, rig)))
    checked = check(folder)
    words = 'one prediction over 3600 s, as between the recorded maps, on '
    assert in_words(checked)[0].startswith(words)
    asked = check(folder, interval=30.0)
    assert in_words(asked)[0].startswith('one prediction over 30 s on ')
    assert asked.cost is not None
    assert checked.cost is not None
    assert checked.cost.steps > asked.cost.steps


def test_the_interval_is_that_of_photographs_with_tracer_or_of_maps(tmp_path: Path) -> None:
    rig = check(small_rig()).rig
    assert recorded_interval(None).seconds == 30.0
    photos = (photo(0.0, 'baseline'), *(photo(time) for time in (10.0, 610.0, 1210.0, 2900.0)))
    assert recorded_interval(RecordedData(rig, photos=photos)).seconds == 600.0
    assert recorded_interval(RecordedData(rig, photos=photos[:2])).seconds == 30.0
    write_folder(tmp_path / 'maps', RecordedData(rig, maps=stored_maps(tmp_path, rig)))
    found = recorded_interval(folder_data(tmp_path / 'maps'))
    assert (found.seconds, found.origin) == (3600.0, ', as between the recorded maps,')


def stored_maps(folder: Path, rig: Rig) -> ConcentrationMaps:
    """Return three empty maps, an hour apart."""
    grid = rig.grid(4, 3)
    with ConcentrationWriter(folder / 'three.nc', grid) as writer:
        for hour in range(3):
            writer.append(3600.0 * hour, np.zeros(grid.shape))
    return open_maps(folder / 'three.nc', rig)


def reservoirs(folder: Path, rise_m: float, **heads_m: float) -> Path:
    """Write a rig between two reservoirs whose left level differs from the described one."""
    sides = {'top': 'closed', 'left': 'open', 'right': 'open'}
    boundaries = {**sides, 'heads_m': heads_m or None}
    effect = {'name': 'water_level', 'parameters': {'left': rise_m}}
    return changed(folder, boundaries=boundaries, effects=[effect], control=None)


def test_water_levels_of_effects_count_as_heads(tmp_path: Path) -> None:
    checked = check(reservoirs(tmp_path, 0.01))
    assert checked.remarks == ()
    described = check(changed(tmp_path, boundaries=BETWEEN, control=None))
    rates = [next(w for w in in_words(one) if 'heads: ' in w) for one in (checked, described)]
    assert rates[0] == rates[1]


def test_levels_that_change_are_told_with_the_way_of_the_water() -> None:
    sides = {'top': 'closed', 'left': 'open', 'right': 'open'}
    heads = Boundaries.model_validate({**sides, 'heads_m': {'left': 0.60, 'right': 0.62}})
    levels = {'left': LevelCourse(points=((10.0, 0.63),))}
    rig = load_rig(small_rig()).model_copy(update={'boundaries': heads, 'levels': levels})
    assert "from 'right' to 'left'" in heads_in_words(rig, rig.grid(40, 24))
    (line,) = levels_in_words(rig, rig.grid(40, 24))
    assert 'from 0.6 m (-' in line
    assert 'to 0.63 m (+' in line


def test_levels_that_effects_make_equal_drive_nothing(tmp_path: Path) -> None:
    checked = check(reservoirs(tmp_path, -0.01, left=0.32, right=0.31))
    assert any('equal water levels, which drive no water' in word for word in in_words(checked))


def test_levels_are_told_by_the_name_of_their_water(tmp_path: Path) -> None:
    water = {'canal': {'side': 'left', 'head_m': 0.62}, 'sea': {'side': 'right', 'head_m': 0.6}}
    levels = {'canal': {'points': [[10, 0.61]]}}
    keys = {'boundaries': {'top': 'closed'}, 'water': water, 'control': None}
    lines = in_words(check(changed(tmp_path, levels=levels, **keys)))
    start = next(line for line in lines if line.startswith('heads at the start: '))
    assert "from 'canal' to 'sea'" in start
    (level,) = (line for line in lines if line.startswith('level of canal'))
    low, high = (float(rate) for rate in re.findall(r'\(([+-].*?) ml/h', level))
    np.testing.assert_allclose(high, 2.0 * low, rtol=1e-3)


def test_a_level_in_millimetres_is_refused(tmp_path: Path) -> None:
    assert 'was this in mm' in told(reservoirs(tmp_path, 5.0))


def test_a_steep_fall_of_the_water_is_odd(tmp_path: Path) -> None:
    assert 'are they in cm? write m' in told(reservoirs(tmp_path, 0.4))


def test_values_that_are_read_as_unknown_are_told(tmp_path: Path) -> None:
    rig = load_rig(small_rig())
    write_folder(tmp_path / 'run', RecordedData(rig, maps=stored_maps(tmp_path, rig)))
    with netCDF4.Dataset(tmp_path / 'run' / 'concentration.nc', 'a') as dataset:
        dataset['concentration'].set_auto_maskandscale(False)
        dataset['concentration'][1, 1, 1] = np.inf
    assert 'values are read as not known: inf (1); write NaN there' in told(tmp_path / 'run')


def test_rates_in_ml_per_minute_are_odd(tmp_path: Path) -> None:
    assert pumped(tmp_path, '500 500').remarks == ()
    told = {one.code: one.facts for one in pumped(tmp_path, '8.33 8.33').remarks}
    assert told['little_injected']['volume_ml'] == pytest.approx(4.17, abs=0.01)


def test_an_injection_of_many_pore_volumes_is_odd(tmp_path: Path) -> None:
    changed(tmp_path)
    (tmp_path / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n'
        '0,injector,500,1\n0,producer,-500,\n3e7,injector,0,0\n3e7,producer,0,\n'
    )
    (remark,) = check(tmp_path).remarks
    assert (remark.code, remark.facts['end_s']) == ('much_injected', 3e7)


@pytest.mark.parametrize(('cut', 'told'), [(True, 'cut_photos'), (False, 'it is damaged')])
def test_a_damaged_baseline_photograph_is_one_remark(tmp_path: Path, cut: bool, told: str) -> None:
    from PIL import Image

    folder = tmp_path / 'damaged'
    (folder / 'photos').mkdir(parents=True)
    rig = yaml.safe_load(small_rig().read_text())
    rig['camera'] = {'corners_px': [[10, 10], [10, 90], [150, 90], [150, 10]]}
    (folder / 'rig.yaml').write_text(yaml.safe_dump(rig))
    (folder / 'imaging.csv').write_text('time_s,path,role\n0,photos/a.png,baseline\n')
    noise = np.random.default_rng(1).integers(0, 255, (100, 160, 3), dtype=np.uint8)
    picture = folder / 'photos' / 'a.png'
    Image.fromarray(noise).save(picture)
    whole = picture.read_bytes()
    middle = len(whole) // 2
    rest = b'' if cut else whole[-middle // 2 :]
    picture.write_bytes(whole[:middle] + rest)
    (remark,) = (one for one in check(folder).remarks if one.key == 'photographs')
    assert told in remark.code + remark.why


def test_photographs_without_a_baseline_are_impossible_until_there_are_maps(
    experiment: Path, tmp_path: Path
) -> None:
    folder = tmp_path / 'listed'
    shutil.copytree(experiment, folder)
    text = (folder / 'imaging.csv').read_text()
    (folder / 'imaging.csv').write_text(text.replace(',baseline', ',state'))
    assert check(folder).runs
    (folder / 'concentration.nc').unlink()
    assert check(folder).remarks[0].code == 'no_baseline'
    assert not check(folder).runs


def test_a_list_without_a_photograph_is_odd(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'empty'
    shutil.copytree(experiment, folder)
    (folder / 'imaging.csv').write_text('time_s,path,role\n')
    assert any('lists no photograph' in str(remark) for remark in check(folder).remarks)


def test_a_cut_state_photograph_is_a_remark(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'cut'
    shutil.copytree(experiment, folder)
    last = sorted((folder / 'photos').iterdir())[-1]
    assert 'end before' not in told(folder)
    last.write_bytes(last.read_bytes()[:3000])
    assert f'photos/{last.name} end before their pictures do' in told(folder)


def test_the_picture_replaces_that_of_an_earlier_check_only(tmp_path: Path) -> None:
    shutil.copy(small_rig(), tmp_path / 'rig.yaml')
    assert porotwin('check', tmp_path, '--output', tmp_path).returncode == 0
    assert porotwin('check', tmp_path, '--output', tmp_path).returncode == 0
    (tmp_path / 'check.png').write_bytes(b'a photograph')
    refused = porotwin('check', tmp_path, '--output', tmp_path)
    assert refused.returncode == 2
    assert 'is a file of the input' in refused.stderr
    assert (tmp_path / 'check.png').read_bytes() == b'a photograph'


@pytest.mark.parametrize('name', ['check.jpg', 'check.xyz', 'check'])
def test_a_picture_that_is_no_png_is_refused_before_the_work(name: str, tmp_path: Path) -> None:
    result = porotwin('check', small_rig(), '--output', tmp_path / name)
    assert result.returncode == 2
    assert 'give a name that ends in .png' in result.stderr


def test_a_plan_and_levels_in_another_unit_are_odd(tmp_path: Path) -> None:
    data = yaml.safe_load(small_rig().read_text()) | {'boundaries': BETWEEN}
    data['control']['end_min'] = 80
    data['levels'] = {'left': {'points': [[600, 0.33], [2400, 0.31]]}}
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump(data))
    (tmp_path / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n0,injector,500,1\n0,producer,-500,\n'
        '80,injector,0,1\n80,producer,0,\n'
    )
    odd = {one.key for one in check(tmp_path).remarks if one.code == 'extent'}
    assert odd == {'rates.csv', 'levels.left'}
