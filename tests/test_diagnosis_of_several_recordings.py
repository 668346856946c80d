"""Several recordings of one rig: one size of an effect in all, and more effects told apart."""

import json
import shutil

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import CHASE, DENSER, SKIPPED_FOR_SPEED, SMALL, commanded, recorded

from porotwin_core.errors import InputError
from porotwin_core.rig import write_rig
from porotwin_diagnosis.examine import diagnose


@pytest.fixture(scope='module')
def injection(tmp_path_factory):
    """A recording of tracer from one well: denser sand looks like a larger rate of that well."""
    folder = tmp_path_factory.mktemp('injection') / 'injection'
    return recorded(folder, DENSER, rates=commanded((0, 'injector', 450, 1.0)), duration=2160)


@pytest.fixture(scope='module')
def chase(tmp_path_factory):
    """A recording of the same sand, with another well that drives the tracer on."""
    folder = tmp_path_factory.mktemp('chase') / 'chase'
    return recorded(folder, DENSER, rates=CHASE, duration=2160, seed=4)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_second_recording_separates_effects_that_one_cannot(injection, chase, tmp_path):
    alone = diagnose(injection, tmp_path / 'alone', excluded=SKIPPED_FOR_SPEED).summary
    assert {alone['verdict'], *alone['not_separable_from']} >= {'porosity', 'rate'}
    both = [str(injection), str(chase)]

    summary = diagnose(both, tmp_path / 'both', excluded=SKIPPED_FOR_SPEED).summary
    assert summary == json.loads((tmp_path / 'both' / 'diagnosis.json').read_text())
    assert summary['verdict'] == 'porosity'
    assert 'rate' not in summary['not_separable_from']
    factor = summary['effects'][0]['parameters']['factor']
    assert factor['low'] <= factor['value'] <= factor['high']
    assert factor['value'] == pytest.approx(0.88, abs=0.01)

    assert [part['recording'] for part in summary['by_recording']] == both
    for number, part in enumerate(summary['by_recording']):
        assert part['after'] < 0.5 * part['before']
        assert part['gap_closed_low'] <= part['gap_closed'] <= part['gap_closed_high']
        name = ('fields.nc', 'fields_2.nc')[number]
        with netCDF4.Dataset(tmp_path / 'both' / name) as fields:
            observed = fields['observed'][:]
            error = np.linalg.norm(fields['predicted_after'][:] - observed)
            assert fields['gap'].shape == fields['remainder'].shape == observed.shape[1:]
        assert error / np.linalg.norm(observed) == pytest.approx(part['after'], rel=0.01)
    assert {phase['recording'] for phase in summary['when']} == set(both)
    assert summary['error']['gap_closed'] > 0.9


def test_rigs_with_different_descriptions_are_not_judged_together(injection, tmp_path):
    other = tmp_path / 'tuesday'
    shutil.copytree(injection, other)
    text = (other / 'rig.yaml').read_text()
    changed = SMALL.model_copy(update={'porosity': 0.9 * SMALL.porosity})
    write_rig(changed, other / 'rig.yaml')
    assert (other / 'rig.yaml').read_text() != text
    with pytest.raises(InputError, match=r'tuesday: its rig is not described as .* --rig'):
        diagnose([injection, other], tmp_path / 'out')
