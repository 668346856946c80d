"""./porotwin import and export."""

import json
from pathlib import Path

import numpy as np
from cli_examples import porotwin

from porotwin_recording.experiment.recording import open_recording


def test_a_folder_is_the_same_after_import_and_export(experiment: Path, tmp_path: Path) -> None:
    imported = porotwin('import', experiment, tmp_path / 'bag')
    assert imported.returncode == 0
    assert '7 photographs' in imported.stdout
    result = porotwin('export', tmp_path / 'bag', tmp_path / 'again', '--json')
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)['photographs'] == 7
    before, after = open_recording(experiment), open_recording(tmp_path / 'again')
    np.testing.assert_array_equal(after.concentration, before.concentration)
    assert [p.read() for p in after.photos] == [p.read() for p in before.photos]
    assert after.schedule.at(100.0) == before.schedule.at(100.0)


def test_export_says_what_it_leaves_out(tmp_path: Path) -> None:
    sample = Path(__file__).resolve().parents[3] / 'bags' / 'sample'
    result = porotwin('export', sample, tmp_path / 'sample', '--segment', '1')
    assert result.returncode == 0, result.stderr
    assert 'left out' in result.stderr
    assert '/porotwin/hub/cycle (13)' in result.stderr
    assert 'asset/new_state' not in result.stderr
    result = porotwin('export', sample, tmp_path / 'other', '--segment', '2')
    assert result.returncode == 2
    assert 'holds one experiment; choose a segment from 1 to 1' in result.stderr


def test_nothing_is_overwritten(experiment: Path, tmp_path: Path) -> None:
    (tmp_path / 'bag').mkdir()
    result = porotwin('import', experiment, tmp_path / 'bag')
    assert result.returncode == 2
    assert 'exists already; name another output or remove it' in result.stderr


def test_maps_of_other_programs_become_a_folder_and_a_dataset(
    experiment: Path, tmp_path: Path
) -> None:
    before = open_recording(experiment)
    np.savez(tmp_path / 'maps.npz', maps=before.concentration, t_min=before.times / 60.0)
    words = ('import', tmp_path / 'maps.npz', tmp_path / 'made', '--first-row', 'bottom')
    assert porotwin(*words).returncode == 2  # whose rig?
    result = porotwin(*words, '--rig', experiment / 'rig.yaml')
    assert result.returncode == 0, result.stderr
    assert 'times in min' in result.stderr
    dataset = porotwin('export', tmp_path / 'made', tmp_path / 'made.zarr', '--format', 'zarr')
    assert dataset.returncode == 0, dataset.stderr
    assert 'xarray.open_zarr' in dataset.stdout
    again = porotwin(
        *('import', tmp_path / 'made.zarr', tmp_path / 'again'),
        *('--rig', experiment / 'rig.yaml', '--json'),
    )
    assert json.loads(again.stdout)['maps'] == len(before.times)
    after = open_recording(tmp_path / 'again')
    np.testing.assert_array_equal(after.concentration, before.concentration)


def test_maps_of_a_simulation_need_no_export(tmp_path: Path) -> None:
    (tmp_path / 'model.nc').write_bytes(b'')
    for kind in ('folder', 'zarr'):
        result = porotwin('export', tmp_path / 'model.nc', tmp_path / 'out', '--format', kind)
        assert result.returncode == 2
        assert 'xarray.open_dataset opens it' in result.stderr


def test_a_refused_import_leaves_nothing_and_names_its_source(tmp_path: Path) -> None:
    lab = tmp_path / 'lab'
    lab.mkdir()
    protocol = lab / 'injection_protocol.csv'
    rows = 'well,start,end,rate [UNIT]\ninjector,2024-05-31 10:00,2024-05-31 10:02,2\n'
    protocol.write_text(rows.replace('UNIT', 'l/s'))
    rig = Path(__file__).resolve().parents[3] / 'rigs' / 'small' / 'rig.yaml'
    words = ('import', lab, tmp_path / 'made', '--rig', rig)
    refused = porotwin(*words)
    assert refused.returncode == 2
    line = refused.stderr.strip().splitlines()[-1]
    assert f'{lab}: makes no valid experiment folder: rates.csv: ' in line
    assert str(tmp_path / 'made') not in line
    assert [path.name for path in tmp_path.iterdir()] == ['lab']
    protocol.write_text(rows.replace('UNIT', 'ml/min'))
    assert porotwin(*words).returncode == 0


def test_options_that_would_do_nothing_are_refused(experiment: Path, tmp_path: Path) -> None:
    maps = experiment / 'concentration.nc'
    for source, option in ((experiment, '--stock=100'), (maps, '--camera-ahead=600')):
        result = porotwin('import', source, tmp_path / 'made', option)
        assert result.returncode == 2
        assert f'takes no {option.split("=")[0]}' in result.stderr
        assert not (tmp_path / 'made').exists()


def test_a_part_is_cut_out_of_a_folder(experiment: Path, tmp_path: Path) -> None:
    before = open_recording(experiment)
    last = float(before.times[-1])
    words = ('export', experiment, tmp_path / 'part')
    result = porotwin(*words, '--times', f'{last / 2:g}:{last:g}')
    assert result.returncode == 0, result.stderr
    after = open_recording(tmp_path / 'part')
    late = before.times >= last / 2
    np.testing.assert_array_equal(after.times, before.times[late])
    np.testing.assert_array_equal(after.concentration, before.concentration[late])
    for name, words, kept in (
        ('late', f'{last / 2:g}:', late),
        ('early', f':{last / 2:g}', before.times <= last / 2),
    ):
        assert porotwin('export', experiment, tmp_path / name, '--times', words).returncode == 0
        np.testing.assert_array_equal(open_recording(tmp_path / name).times, before.times[kept])
    form = 'write START:END in seconds, like 0:7200, 1800: or :7200'
    for wrong, complaint in (
        ('600', form),
        (':', form),
        ('nan:1', form),
        ('600:0', 'END lies before START'),
        ('600:600', 'END is START'),
        (f'{last + 1:g}:{last + 2:g}', 'no map and no photograph from'),
        (f'{last + 1:g}:', f'no map and no photograph from {last + 1:g} s on; it covers'),
    ):
        refused = porotwin('export', experiment, tmp_path / 'none', '--times', wrong)
        assert refused.returncode == 2
        assert complaint in refused.stderr
        assert len(refused.stderr.strip().splitlines()) == 1
        assert not (tmp_path / 'none').exists()


def test_a_folder_of_photographs_becomes_an_experiment_with_their_times(
    experiment: Path, tmp_path: Path
) -> None:
    lab = tmp_path / 'lab'
    lab.mkdir()
    before = open_recording(experiment).photos
    for number, photo in enumerate(before):
        (lab / f'IMG_{9997 + number if number < 3 else number - 2:04d}.JPG').write_bytes(
            photo.read()
        )
    result = porotwin('import', lab, tmp_path / 'made', '--rig', experiment / 'rig.yaml')
    assert result.returncode == 0, result.stderr
    assert 'photographs with times in EXIF: 7' in result.stderr
    after = open_recording(tmp_path / 'made').photos
    assert [photo.read() for photo in after] == [photo.read() for photo in before]
    times = [photo.time - before[0].time for photo in before]
    np.testing.assert_allclose([photo.time for photo in after], times, atol=2e-3)
