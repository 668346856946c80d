"""The folder of a report: refused before a diagnosis, complete after it."""

import json
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import DENSER, all_but, recorded
from diagnosis_results import naming, on_rig, twice

from lab.blind.blind_cases import SMALL
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig, load_rig, parse_rig, write_rig
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
from porotwin_recording.experiment.recording import open_recording


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_wrong_porosity_is_named_and_the_rig_corrected(tmp_path):
    recording = recorded(tmp_path / 'recording', DENSER, grid=SMALL.grid(62, 37))
    stages = []

    def progress(stage, fraction):
        stages.append((stage, fraction))

    folder = checked_folder(tmp_path / 'out', [recording])
    recordings = [open_recording(recording)]
    result = examine(
        recordings,
        DiagnosisSettings(excluded=all_but('porosity', 'rate', 'clock'), progress=progress),
    )
    assert list(folder.iterdir()) == [], 'examine writes nothing'
    summary = write_diagnosis(result, folder, apply=True, progress=progress)

    stated = json.loads((folder / 'diagnosis.json').read_text())
    assert stated == summary
    assert stated['verdict'] == 'porosity'
    assert stated['error']['gap_closed'] > 0.8
    assert stated['effects'][0]['parameters']['factor']['value'] == pytest.approx(0.88, abs=0.01)
    assert stated['where']['centre'] is None
    page = (folder / 'report.html').read_text()
    assert page.count('data:image/png;base64,') == 4
    assert 'http' not in page.replace('http-equiv', '')
    assert_fields_agree(folder / 'fields.nc', stated['error'], falls_to=0.6)
    corrected = load_rig(folder / 'rig.yaml')
    assert [effect.name for effect in corrected.effects] == ['porosity']
    assert stages[-1] == ('done', 1.0)
    fractions = [fraction for _, fraction in stages]
    assert fractions == sorted(fractions)


@pytest.mark.usefixtures('undrawn')
def test_every_recording_has_its_own_fields(coarse_denser, tmp_path):
    summary = write_diagnosis(twice(coarse_denser), tmp_path)
    assert summary == json.loads((tmp_path / 'diagnosis.json').read_text())
    names = ('fields.nc', 'fields_2.nc')
    for name, part in zip(names, summary['by_recording'], strict=True):
        assert_fields_agree(tmp_path / name, part, falls_to=0.5)
    assert not (tmp_path / 'rig.yaml').exists(), 'only with apply'
    write_diagnosis(coarse_denser, tmp_path)
    assert [file.name for file in tmp_path.glob('fields*')] == ['fields.nc'], 'now of one recording'


def assert_fields_agree(path, errors, *, falls_to):
    """Assert that the maps in `path` have the stated errors, and that the error falls."""
    with netCDF4.Dataset(path) as fields:
        observed = fields['observed'][:]
        after = np.linalg.norm(fields['predicted_after'][:] - observed)
        before = np.linalg.norm(fields['predicted_before'][:] - observed)
        assert fields['gap'].shape == fields['remainder'].shape == observed.shape[1:]
    assert after < falls_to * before
    assert after / np.linalg.norm(observed) == pytest.approx(errors['after'], rel=0.01)


def test_a_report_that_cannot_be_written_is_refused(quiet, tmp_path):
    taken = tmp_path / 'taken'
    taken.write_text('a file')
    for output, complaint in ((taken, 'exists; name another'), (quiet, 'is the recording; name')):
        with pytest.raises(InputError, match=complaint):
            checked_folder(output, [quiet])


def test_the_folder_of_a_recording_or_of_its_rig_is_refused(quiet, tmp_path):
    bag = tmp_path / 'bag'
    bag.mkdir()
    (bag / 'bag_0.mcap').touch()
    for folder, read in (
        (quiet, quiet / 'rig.yaml'), (bag, bag / 'bag_0.mcap'), (bag, quiet),
    ):  # fmt: skip
        with pytest.raises(InputError, match=r'holds .*; name another folder for the report'):
            checked_folder(folder, [read])
    assert [file.name for file in bag.iterdir()] == ['bag_0.mcap']


@pytest.mark.usefixtures('undrawn')
def test_files_that_no_diagnosis_wrote_are_not_replaced(tmp_path):
    (tmp_path / 'report.html').write_text('precious')
    with pytest.raises(InputError, match=r'holds report.html, but no diagnosis.json'):
        checked_folder(tmp_path, [])
    (tmp_path / 'report.html').rename(tmp_path / 'fields.nc')
    with pytest.raises(InputError, match=r'holds fields.nc, but no diagnosis.json'):
        checked_folder(tmp_path, [])
    (tmp_path / 'fields.nc').unlink()
    (tmp_path / 'fields.nc').mkdir()
    with pytest.raises(InputError, match=r'fields.nc: is a folder'):
        checked_folder(tmp_path, [])


@pytest.mark.usefixtures('undrawn')
def test_a_rig_that_no_diagnosis_wrote_is_never_replaced(coarse_denser, tmp_path):
    own = tmp_path / 'myrig'
    own.mkdir()
    write_rig(SMALL, own / 'rig.yaml')
    with pytest.raises(InputError, match=r'myrig: holds a rig\.yaml that no diagnosis wrote.*move'):
        checked_folder(own, [])
    report = checked_folder(tmp_path / 'report', [])
    write_diagnosis(coarse_denser, report, apply=True)
    assert checked_folder(report, []) == report, 'a diagnosis wrote it'
    shutil.copy(report / 'rig.yaml', own)
    with pytest.raises(InputError, match='myrig'):
        checked_folder(own, [])  # a copy is no report
    with (report / 'rig.yaml').open('a') as file:
        file.write('# corrected by hand\n')
    with pytest.raises(InputError, match='edited'):
        checked_folder(report, [])


@pytest.mark.usefixtures('undrawn')
def test_a_rig_of_an_earlier_diagnosis_goes_with_it(coarse_denser, tmp_path):
    with_map = on_rig(coarse_denser, rig_with_depth_map(tmp_path / 'fields.nc'))
    report = checked_folder(tmp_path / 'report', [])
    write_diagnosis(with_map, report)
    alone = names_in(report)
    write_diagnosis(with_map, report, apply=True)
    assert names_in(report) == {*alone, 'rig.yaml', 'depth_m.nc'}
    write_diagnosis(with_map, report, apply=True)
    assert names_in(report) == {*alone, 'rig.yaml', 'depth_m.nc'}
    other = naming(with_map, 'rate', {'factor': 0.9})
    write_diagnosis(other, report)
    assert names_in(report) == alone


@pytest.mark.usefixtures('undrawn')
@pytest.mark.parametrize('name', ['fields.nc', 'fields_2.nc', 'notes.nc'])
def test_maps_beside_the_rig_replace_no_file(name, coarse_denser, tmp_path):
    rig = rig_with_depth_map(tmp_path / name)
    report = checked_folder(tmp_path / 'report', [])
    (report / 'notes.nc').write_text('mine')
    write_diagnosis(on_rig(coarse_denser, rig), report, apply=True)
    assert (report / 'notes.nc').read_text() == 'mine'
    with netCDF4.Dataset(report / 'fields.nc') as fields:
        assert 'gap' in fields.variables
    corrected = load_rig(report)
    assert [effect.name for effect in corrected.effects] == ['porosity']
    np.testing.assert_array_equal(corrected.nominal_map('depth_m'), rig.nominal_map('depth_m'))


@pytest.mark.usefixtures('undrawn')
def test_an_interrupted_report_has_no_page(coarse_denser, tmp_path, monkeypatch):
    write_diagnosis(coarse_denser, tmp_path)

    def fails(*_):
        raise OSError

    monkeypatch.setattr('porotwin_diagnosis.report.report_folder.write_fields', fails)
    with pytest.raises(OSError):
        write_diagnosis(coarse_denser, tmp_path)
    assert not (tmp_path / 'report.html').exists()


@pytest.mark.usefixtures('undrawn')
def test_a_full_disk_leaves_no_half_of_the_maps(coarse_denser, tmp_path, monkeypatch):
    def fails(path, *_):
        path.write_bytes(b'half')
        raise RuntimeError('NetCDF: HDF error')

    monkeypatch.setattr('porotwin_diagnosis.report.held_out_fields._write', fails)
    with pytest.raises(OSError, match=r'fields\.nc'):
        write_diagnosis(coarse_denser, tmp_path)
    assert not [name for name in names_in(tmp_path) if name.startswith('fields')]


def names_in(folder: Path) -> set[str]:
    """Return the names of the files in `folder`."""
    return {file.name for file in folder.iterdir()}


def rig_with_depth_map(path: Path) -> Rig:
    """Return the small rig with a depth map in the file `path`, which is written."""
    with netCDF4.Dataset(path, 'w') as dataset:
        for axis, size in (('z', 5), ('x', 7)):
            dataset.createDimension(axis, size)
        values = np.random.default_rng(3).uniform(0.018, 0.022, (5, 7))
        dataset.createVariable('depth', 'f8', ('z', 'x'))[:] = values
    data = SMALL.model_dump(mode='json', exclude_defaults=True)
    depth = {'file': path.name, 'variable': 'depth'}
    return parse_rig({**data, 'depth_m': depth}, path.parent / 'rig.yaml')


@pytest.mark.parametrize('name', ['rates.csv', 'concentration.nc', 'imaging.csv'])
def test_the_folder_of_another_recording_is_refused(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=f'holds {name} of a recording; name another folder'):
        checked_folder(tmp_path, [])
