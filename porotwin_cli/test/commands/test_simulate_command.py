"""./porotwin simulate."""

import json
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import yaml
from cli_examples import one_well_rig, porotwin

from porotwin_cli.commands import simulate
from porotwin_cli.pictures import rig_drawing
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import ConcentrationWriter


@pytest.mark.usefixtures('undrawn')
def test_simulate_follows_the_rig(experiment: Path, tmp_path: Path) -> None:
    result = porotwin('simulate', experiment, '--output', tmp_path / 'model.nc', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert answer['grid'] == '94x56'
    errors = answer['errors']
    assert errors['blurred_error'] <= errors['error'] < 0.1
    assert errors['noise'] < 0.05
    recording = open_recording(experiment)
    with netCDF4.Dataset(tmp_path / 'model.nc') as dataset:
        model = np.asarray(dataset['concentration'][:])
    observed = np.asarray(recording.concentration)
    assert model.shape == observed.shape
    error = np.linalg.norm(model[-1] - observed[-1]) / np.linalg.norm(observed[-1])
    assert error < 0.1


def test_the_picture_shows_the_maps_that_are_written(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[np.ndarray] = []
    monkeypatch.setattr(
        rig_drawing, 'sheet_of_maps', lambda *arguments, **_: drawn.extend(arguments[3])
    )
    simulate.command(experiment, tmp_path / 'model.nc', '20x12', times='0:60:60', blur=2.0)
    with netCDF4.Dataset(tmp_path / 'model.nc') as dataset:
        written = np.asarray(dataset['concentration'][-1])
    np.testing.assert_allclose(drawn[-1], written, atol=1e-6)


RIG = one_well_rig(0.3, 0.2)


def test_simulate_takes_its_times_from_the_rates(tmp_path: Path) -> None:
    (tmp_path / 'rig.yaml').write_text(RIG)
    rates = 'time_s,well,rate_ml_h,concentration\n0,injector,100,1\n'
    (tmp_path / 'rates.csv').write_text(rates + '100,injector,0,\n')
    result = porotwin('simulate', tmp_path, '--output', tmp_path / 'model.nc', '--grid', '15x10')
    assert result.returncode == 0, result.stderr
    with netCDF4.Dataset(tmp_path / 'model.nc') as dataset:
        assert dataset['time'][:].tolist() == [0.0, 30.0, 60.0, 90.0, 100.0]
    assert (tmp_path / 'model.png').read_bytes().startswith(b'\x89PNG')
    (tmp_path / 'rates.csv').write_text(rates)
    result = porotwin('simulate', tmp_path, '--output', tmp_path / 'again.nc')
    assert result.returncode == 2
    assert 'do not say when the experiment ends' in result.stderr


@pytest.mark.parametrize(
    ('times', 'complaint'),
    [
        ('0:1e7:1', 'more than 100000 maps; take a larger STEP'),
        ('1e300:1e300:1', 'end after 365 days'),
        ('-100:100:50', 'begin before the experiment'),
        ('0:nan:1', 'write START:END:STEP'),
        ('100:0:10', 'write START:END:STEP'),
        ('0:100:0', 'write START:END:STEP'),
    ],
)
def test_impossible_times_are_refused(tmp_path: Path, times: str, complaint: str) -> None:
    (tmp_path / 'rig.yaml').write_text(RIG)
    (tmp_path / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n0,injector,100,1\n')
    with pytest.raises(InputError, match=complaint):
        simulate.command(tmp_path, tmp_path / 'model.nc', times=times)


@pytest.mark.usefixtures('undrawn')
def test_simulate_with_an_effect_differs(experiment: Path, tmp_path: Path) -> None:
    effect = 'rate:well=injector,factor=0.5'
    for name, extra in (('plain', []), ('weak', ['--effect', effect])):
        arguments = ['--output', tmp_path / f'{name}.nc', '--times', '0:180:90', *extra]
        result = porotwin('simulate', experiment, *arguments)
        assert result.returncode == 0
        assert '3 maps on 94x56' in result.stdout
    masses = []
    for name in ('plain', 'weak'):
        with netCDF4.Dataset(tmp_path / f'{name}.nc') as dataset:
            masses.append(float(np.sum(dataset['concentration'][-1])))
    assert masses[1] == pytest.approx(0.5 * masses[0], rel=0.05)


def test_an_unknown_effect_or_grid_is_refused(experiment: Path, tmp_path: Path) -> None:
    for arguments, named in (
        (['--effect', 'magic:x=1'], "'magic'"),
        (['--grid', 'huge'], "'huge'"),
        (['--times', 'now'], "'now'"),
        (['--output', tmp_path / 'model.png'], 'model.png'),
    ):
        result = porotwin('simulate', experiment, '--output', tmp_path / 'x.nc', *arguments)
        assert result.returncode == 2, result.stderr
        assert named in result.stderr
    assert not (tmp_path / 'x.nc').exists()


def test_missing_rates_and_an_effect_given_twice_are_refused_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'rig.yaml').write_text(RIG)
    output, times = tmp_path / 'model.nc', '0:1000000:1000'
    with ConcentrationWriter(tmp_path / 'concentration.nc', Grid(6, 4, 0.3, 0.2)) as writer:
        writer.append(0.0, np.zeros((4, 6)))
    with pytest.raises(InputError, match=r'add rates\.csv'):
        simulate.command(tmp_path, output, grid='60x40', times=times)
    rates = 'time_s,well,rate_ml_h,concentration\n0,injector,100,1\n'
    (tmp_path / 'rates.csv').write_text(rates)
    twice = ['decay:rate=1e-4', 'decay:rate=1e-3']
    with pytest.raises(InputError, match='decay is given twice'):
        simulate.command(tmp_path, output, grid='60x40', times=times, effect=twice)
    assert 'cells' not in capsys.readouterr().err
    assert not output.exists()


@pytest.mark.usefixtures('undrawn')
def test_a_closed_rig_whose_wells_take_turns_is_simulated(tmp_path: Path) -> None:
    rig = yaml.safe_load(small_rig().read_text())
    rig['boundaries'] = dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    rig.pop('control', None)
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump(rig))
    (tmp_path / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n0,injector,500,1\n0,producer,-500,\n'
        '60,injector,300,1\n60,producer,0,\n60,control1,-300,\n'
    )
    result = porotwin(
        'simulate',
        tmp_path,
        '--output',
        tmp_path / 'maps.nc',
        '--times',
        '0:120:60',
        '--grid',
        '40x24',
    )
    assert result.returncode == 0, result.stderr
