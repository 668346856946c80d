"""./porotwin image."""

import errno
import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import netCDF4
import numpy as np
import pytest
from cli_examples import porotwin
from sparse_bags import SparseBag

from porotwin_checks import tracer_errors
from porotwin_cli.commands.image import command
from porotwin_cli.photographs import imaged_maps
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_imaging.tracer import calibration
from porotwin_imaging.tracer.calibration import Calibration, load_calibration, save_calibration
from porotwin_recording.experiment.photo_source import fingerprints
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap import topic_names
from porotwin_recording.tables.concentration import open_maps
from porotwin_recording.tables.map_parts import MapParts

LARGE = 20_000_000
"""Size that every photograph of the large bag claims [B]."""


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


@pytest.mark.usefixtures('undrawn')
def test_image_keeps_the_calibration_that_it_used(
    experiment: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, learnt = tmp_path / 'calibration.yaml', tmp_path / 'learnt'
    save_calibration(Calibration(), given)
    command(experiment, tmp_path / 'maps.nc', '40x24', given, learnt)
    assert f'--calibration {learnt}/calibration.yaml' in capsys.readouterr().err
    assert load_calibration(learnt / 'calibration.yaml').response == Calibration().response
    with pytest.raises(InputError, match='exists already'):
        command(experiment, tmp_path / 'maps.nc', '40x24', given, learnt)
    with pytest.raises(InputError, match='name one with --calibration'):
        command(experiment, tmp_path / 'maps.nc', '40x24', None, tmp_path / 'other')


@pytest.mark.usefixtures('undrawn')
def test_a_call_that_goes_on_finds_no_learnt_calibration_of_the_interrupted_one(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, learnt = tmp_path / 'calibration.yaml', tmp_path / 'learnt'
    save_calibration(Calibration(), given)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(imaged_maps, 'write_maps', interrupted)
        command(experiment, tmp_path / 'maps.nc', '40x24', given, learnt)
    command(experiment, tmp_path / 'maps.nc', '40x24', given, learnt)
    assert (learnt / 'calibration.yaml').is_file()


@pytest.mark.usefixtures('undrawn')
def test_a_disk_that_is_full_after_the_maps_leaves_no_part_of_a_learnt_calibration(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, learnt, maps = tmp_path / 'calibration.yaml', tmp_path / 'learnt', tmp_path / 'maps.nc'
    save_calibration(Calibration(), given)

    def full(_: Calibration, path: Path) -> None:
        path.parent.mkdir(exist_ok=True)
        path.with_name('sands.png').write_bytes(b'part')
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(calibration, 'save_calibration', full)
    with pytest.raises(OSError, match=r'no space left.*the maps are complete in .*maps\.nc'):
        command(experiment, maps, '40x24', given, learnt)
    assert maps.is_file()
    assert not learnt.exists()


@pytest.fixture
def large_bag(experiment: Path, tmp_path: Path) -> Path:
    """The photographs of `experiment` as a bag of two files; each claims 20 MB, mostly a hole."""
    photos = open_recording(experiment).photos
    (tmp_path / 'large').mkdir()
    for number, part in enumerate((photos[:4], photos[4:])):
        bag = SparseBag(tmp_path / 'large' / f'large_{number}.mcap', load_rig(experiment))
        for place, photo in enumerate(part, start=4 * number - 1):
            topic = 'camera/baseline/compressed' if photo.role == 'baseline' else topic_names.IMAGE
            bag.photograph(place, LARGE, topic=topic, content=photo.read())
        bag.close()
    return tmp_path / 'large'


@pytest.mark.usefixtures('undrawn')
def test_image_of_a_large_bag_goes_on_after_a_kill(
    experiment: Path, large_bag: Path, tmp_path: Path
) -> None:
    words = ('image', large_bag, '--grid', '94x56', '--json', '--output')
    rig, output = load_rig(experiment), tmp_path / 'maps.nc'
    whole = json.loads(porotwin(*words, tmp_path / 'whole.nc', '--workers', '1').stdout)['maps']
    maps = open_maps(tmp_path / 'whole.nc', rig)
    assert [entry['photo'] for entry in whole] == [f'photos/state_{n:04d}.jpg' for n in range(1, 7)]
    source = fingerprints(open_recording(large_bag))
    with (
        pytest.raises(KeyboardInterrupt),
        MapParts(output, rig, maps.grid, source=source, origin=maps.origin) as writer,
    ):
        for number, (values, own, shared) in enumerate(maps.with_deviations()):
            if number in (0, 2, 3):  # the second one was refused
                time = float(maps.times[number])
                writer.append(time, values, deviation=own, systematic=shared)
        raise KeyboardInterrupt
    result = porotwin(*words, output, '--workers', '2')
    assert result.returncode == 0, result.stderr
    assert 'going on behind 3 maps' in result.stderr
    answer = json.loads(result.stdout)
    assert all(isinstance(entry['remarks'], list) for entry in answer['maps'])
    again, refused = answer['maps'], whole.pop(1)
    (reason,) = answer['refused']
    assert reason.startswith(f'{refused["photo"]}: ')
    assert [entry['photo'] for entry in again] == [entry['photo'] for entry in whole]
    assert [entry['plume'] for entry in again] == [entry['plume'] for entry in whole]
    np.testing.assert_array_equal(open_maps(output, rig)[:], np.delete(maps[:], 1, axis=0))
    assert not output.with_name('maps.nc.parts').exists()


@pytest.mark.usefixtures('undrawn')
def test_image_begins_anew_if_a_picture_of_the_calibration_was_repainted(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """Maps with two masks must not be mixed: the file names its pictures only."""
    folder, given, output = tmp_path / 'experiment', tmp_path / 'c.yaml', tmp_path / 'maps.nc'
    shutil.copytree(experiment, folder)
    (folder / 'concentration.nc').unlink(missing_ok=True)
    hidden = np.zeros((20, 40), np.uint8)
    save_calibration(Calibration(hidden=hidden), given)
    append = MapParts.append

    def interrupted(self: MapParts, time: float, *rest: Any, **others: Any) -> None:
        append(self, time, *rest, **others)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(MapParts, 'append', interrupted)
        with pytest.raises(KeyboardInterrupt):
            command(folder, output, '40x24', given)
    assert output.with_name('maps.nc.parts').exists()
    capsys.readouterr()
    hidden[:, :20] = 255
    cv2.imwrite(str(tmp_path / 'hidden.png'), hidden)
    command(folder, output, '40x24', given)
    told = capsys.readouterr().err
    assert 'beginning anew: pictures of the calibration changed' in told
    assert np.isnan(open_maps(output, load_rig(folder))[:][:, :, :20]).all()


@pytest.mark.usefixtures('undrawn')
def test_image_names_photographs_of_a_frozen_camera(
    experiment: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    (folder / 'concentration.nc').unlink(missing_ok=True)
    names = [photo.name for photo in open_recording(folder).photos if photo.role == 'state']
    for name in names[3:5]:
        shutil.copy(folder / names[2], folder / name)
    command(folder, tmp_path / 'maps.nc', '40x24', as_json=True)
    answer, told = capsys.readouterr()
    assert f'{names[2]} to {names[4]} (3 photographs) are each the same file' in told
    (run,) = json.loads(answer)['same_files']
    assert run == {'first': names[2], 'last': names[4], 'photographs': 3}


@pytest.mark.usefixtures('undrawn')
def test_image_blames_a_covered_baseline_and_not_the_photographs(
    experiment: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    (folder / 'concentration.nc').unlink(missing_ok=True)
    (name,) = (one.name for one in open_recording(folder).photos if one.role == 'baseline')
    picture = cv2.imread(str(folder / name))
    rows, columns, _ = picture.shape
    picture[rows // 3 : 2 * rows // 3, columns // 3 : columns // 2] = (120, 150, 200)
    cv2.imwrite(str(folder / name), picture)
    command(folder, tmp_path / 'maps.nc', '40x24', as_json=True)
    answer, told = capsys.readouterr()
    covered = json.loads(answer)['remarks'][0]
    assert (covered['code'], covered['facts']['files']) == ('covered_baseline', f' {folder / name}')
    assert 'is covered or damaged in the photograph' not in told


@pytest.mark.usefixtures('undrawn')
def test_image_leaves_out_photographs_that_cannot_be_used(experiment: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    lines = (folder / 'imaging.csv').read_text().splitlines()
    names = [line.split(',')[1] for line in lines]
    time, _, role = lines[3].split(',')
    lines[4] = f'{time},{names[4]},{role}'
    (folder / 'imaging.csv').write_text('\n'.join(lines))
    (folder / names[5]).unlink()
    (folder / names[5]).touch()
    output = tmp_path / 'maps.nc'
    result = porotwin('image', folder, '--output', output, '--grid', '94x56', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert len(answer['maps']) == 4
    assert 'times must increase' in answer['refused'][0]
    assert answer['refused'][1] == (
        f'{names[5]}: photograph of 0 bytes: not a JPEG, PNG or TIFF; send it again, or set the '
        'camera to JPEG'
    )
    with netCDF4.Dataset(output) as dataset:
        assert len(dataset['time']) == 4


def test_image_does_not_replace_its_input(experiment: Path) -> None:
    maps = experiment / 'concentration.nc'
    before = maps.read_bytes()
    result = porotwin('image', experiment, '--output', maps)
    assert result.returncode == 2
    assert 'is a file of the input' in result.stderr
    assert maps.read_bytes() == before


@pytest.mark.usefixtures('undrawn')
def test_image_tells_what_is_odd_about_a_photograph(
    experiment: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A hand in front of one photograph, and maps whose times are turned round."""
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    (folder / 'concentration.nc').unlink(missing_ok=True)
    lines = (folder / 'imaging.csv').read_text().splitlines()
    times = [line.split(',')[0] for line in lines if line.endswith('state')]
    others = [line for line in lines if not line.endswith('state')]
    states = [line.split(',', 1)[1] for line in lines if line.endswith('state')]
    turned = [f'{t},{rest}' for t, rest in zip(times, reversed(states), strict=True)]
    (folder / 'imaging.csv').write_text('\n'.join([*others, *turned]) + '\n')
    name = states[0].split(',')[0]
    picture = cv2.imread(str(folder / name))
    rows, columns, _ = picture.shape
    picture[rows // 3 : rows // 2, columns // 8 : columns // 4] = (120, 150, 200)
    cv2.imwrite(str(folder / name), picture)
    given = tmp_path / 'calibration.yaml'
    save_calibration(Calibration(), given)
    command(folder, tmp_path / 'maps.nc', '40x24', given)
    told = capsys.readouterr().err
    assert f'{name}: ' in told
    assert 'in reversed order the maps hold the injected tracer' in told


@pytest.mark.usefixtures('undrawn')
def test_image_names_swapped_photographs(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(tracer_errors, 'CLEAN', 0.001)  # three minutes inject little
    folder, given = tmp_path / 'experiment', tmp_path / 'calibration.yaml'
    shutil.copytree(experiment, folder)
    (folder / 'concentration.nc').unlink(missing_ok=True)
    first, *_, last, _ = (p.name for p in open_recording(folder).photos if p.role == 'state')
    early, late = (folder / name for name in (first, last))
    content = early.read_bytes()
    early.write_bytes(late.read_bytes())
    late.write_bytes(content)
    save_calibration(Calibration(), given)
    command(folder, tmp_path / 'maps.nc', '94x56', given)
    assert f'{last} shows ' in capsys.readouterr().err
