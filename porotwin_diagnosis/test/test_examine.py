"""The diagnosis from a folder to a report, on recordings of an independent simulator."""

import json

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import SKIPPED_FOR_SPEED

from porotwin_core.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_diagnosis.examine import diagnose


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_wrong_porosity_is_named_and_the_rig_mended(denser_sand, tmp_path):
    stages = []
    diagnose(
        denser_sand,
        tmp_path / 'out',
        apply=True,
        progress=lambda stage, share: stages.append((stage, share)),
    )
    said = json.loads((tmp_path / 'out' / 'diagnosis.json').read_text())
    assert said['verdict'] == 'porosity'
    assert said['error']['gap_closed'] > 0.8
    assert said['effects'][0]['parameters']['factor']['value'] == pytest.approx(0.88, abs=0.01)
    assert said['where']['centre'] is None
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert page.count('data:image/png;base64,') == 3
    assert 'http' not in page.replace('http-equiv', '')
    with netCDF4.Dataset(tmp_path / 'out' / 'fields.nc') as fields:
        observed = fields['observed'][:]
        after = np.linalg.norm(fields['predicted_after'][:] - observed)
        before = np.linalg.norm(fields['predicted_before'][:] - observed)
        assert fields['gap'].shape == observed.shape[1:]
    assert after < 0.6 * before
    assert after / np.linalg.norm(observed) == pytest.approx(said['error']['after'], rel=0.01)
    mended = load_rig(tmp_path / 'out' / 'rig.yaml')
    assert [effect.name for effect in mended.effects] == ['porosity']
    assert stages[-1] == ('done', 1.0)
    shares = [share for _, share in stages]
    assert shares == sorted(shares)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_diffusive_scheme_is_called_numerical_and_not_dispersion(quiet, tmp_path):
    result = diagnose(quiet, tmp_path / 'out', preset='upwind', excluded=SKIPPED_FOR_SPEED)
    assert result.verdict.name == 'numerical_diffusion'
    assert result.numerics.model_diffusion > 1e-8
    assert result.summary['error']['gap_closed'] > 0.8


def test_a_recording_too_short_to_judge_is_refused_in_one_line(tmp_path):
    from diagnosis_examples import SMALL, schedule

    from porotwin_rig.experiment import make_experiment

    make_experiment(
        tmp_path / 'short',
        SMALL,
        told=schedule(),
        duration=300,
        photo_interval=60,
        seed=1,
        grid=SMALL.grid(47, 28),
    )
    with pytest.raises(InputError, match='too few'):
        diagnose(tmp_path / 'short', tmp_path / 'out')


def test_a_preset_that_does_not_exist_is_refused_before_the_search(quiet, tmp_path):
    stages = []
    with pytest.raises(InputError, match="preset 'fats': unknown"):
        diagnose(quiet, tmp_path, preset='fats', progress=lambda stage, _: stages.append(stage))
    assert stages == []


def test_a_report_that_cannot_be_written_is_refused_before_the_search(quiet, tmp_path):
    taken = tmp_path / 'taken'
    taken.write_text('a file')
    stages = []
    for output, complaint in ((taken, 'exists; name another'), (quiet, 'is the recording; name')):
        with pytest.raises(InputError, match=complaint):
            diagnose(quiet, output, progress=lambda stage, _: stages.append(stage))
    assert stages == []
