"""./porotwin image."""

import json
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from cli_examples import porotwin

from porotwin_core.rig import load_rig
from porotwin_recording.concentration import ConcentrationWriter, open_maps


def test_image_turns_photographs_into_maps(experiment: Path, tmp_path: Path) -> None:
    output = tmp_path / 'maps.nc'
    result = porotwin('image', experiment, '--output', output, '--grid', '94x56', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert len(answer['maps']) == 6
    assert answer['refused'] == []
    assert answer['calibrated'] is False
    assert (tmp_path / 'maps.png').read_bytes().startswith(b'\x89PNG')
    with netCDF4.Dataset(output) as dataset:
        seen = np.ma.filled(dataset['concentration'][-1].astype(float), np.nan)
    assert np.nanmax(seen) > 0.5


def test_image_goes_on_where_an_interrupted_call_stopped(experiment: Path, tmp_path: Path) -> None:
    words = ('image', experiment, '--grid', '94x56', '--json', '--output')
    whole = json.loads(porotwin(*words, tmp_path / 'whole.nc').stdout)['maps']
    maps = open_maps(tmp_path / 'whole.nc', load_rig(experiment))
    source = f'{experiment.resolve()}, 1 baselines'
    with (
        pytest.raises(KeyboardInterrupt),
        ConcentrationWriter(
            tmp_path / 'maps.nc', maps.grid, origin=maps.origin, resume=source
        ) as writer,
    ):
        for time, (values, own, shared) in zip(
            maps.times[:4], maps.with_deviations(), strict=False
        ):
            writer.append(float(time), values, deviation=own, systematic=shared)
        raise KeyboardInterrupt
    result = porotwin(*words, tmp_path / 'maps.nc')
    assert result.returncode == 0, result.stderr
    assert 'going on behind 4 maps' in result.stderr
    again = json.loads(result.stdout)['maps']
    assert [entry['photo'] for entry in again] == [entry['photo'] for entry in whole]
    assert [entry['plume'] for entry in again] == [entry['plume'] for entry in whole]
    np.testing.assert_array_equal(open_maps(tmp_path / 'maps.nc', load_rig(experiment))[:], maps[:])
    assert not list(tmp_path.glob('*.partial'))


def test_image_leaves_out_photographs_that_cannot_be_used(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    lines = (folder / 'imaging.csv').read_text().splitlines()
    names = [line.split(',')[1] for line in lines]
    time, _, role = lines[3].split(',')
    lines[4] = f'{time},{names[4]},{role}'
    (folder / 'imaging.csv').write_text('\n'.join(lines))
    (folder / names[5]).unlink()
    (folder / names[5]).symlink_to('/proc/self/mem')  # exists, but nobody can read it
    output = tmp_path / 'maps.nc'
    result = porotwin('image', folder, '--output', output, '--grid', '94x56', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert len(answer['maps']) == 4
    assert 'times must increase' in answer['refused'][0]
    assert answer['refused'][1] == f'{names[5]}: cannot be read (Input/output error)'
    with netCDF4.Dataset(output) as dataset:
        assert len(dataset['time']) == 4


def test_image_does_not_replace_its_input(experiment: Path) -> None:
    rig = experiment / 'rig.yaml'
    before = rig.read_bytes()
    result = porotwin('image', experiment, '--output', rig)
    assert result.returncode == 2
    assert 'is a file of the input' in result.stderr
    assert rig.read_bytes() == before
