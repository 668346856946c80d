"""The folder of a report: refused before a diagnosis, complete after it."""

import json

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import SKIPPED_FOR_SPEED
from diagnosis_results import twice

from porotwin_core.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_diagnosis.examine import examine
from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
from porotwin_recording.recording import open_recording


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_wrong_porosity_is_named_and_the_rig_corrected(denser_sand, tmp_path):
    stages = []

    def progress(stage, fraction):
        stages.append((stage, fraction))

    folder = checked_folder(tmp_path / 'out', [denser_sand])
    recordings = [open_recording(denser_sand)]
    result = examine(recordings, excluded=SKIPPED_FOR_SPEED, progress=progress)
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


def test_every_recording_has_its_own_fields(denser, tmp_path):
    summary = write_diagnosis(twice(denser), tmp_path)
    assert summary == json.loads((tmp_path / 'diagnosis.json').read_text())
    names = ('fields.nc', 'fields_2.nc')
    for name, part in zip(names, summary['by_recording'], strict=True):
        assert_fields_agree(tmp_path / name, part, falls_to=0.5)
    assert not (tmp_path / 'rig.yaml').exists(), 'only with apply'


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
