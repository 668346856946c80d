"""Several recordings of one rig: one size of the effect in all, and more that can be told apart."""

import json
import shutil

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import BESIDE_THE_POINT, SMALL, recorded

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription, write_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.examine import diagnose
from porotwin_diagnosis.model.gap_map import map_gap
from porotwin_recording.recording import open_recording

DENSER = EffectDescription(name='porosity', parameters={'factor': 0.88})


def told(*rows):
    return Schedule(
        tuple(
            ScheduleRow(float(time), well, WellRate(from_ml_h(rate), c))
            for time, well, rate, c in rows
        )
    )


CHASE = told(
    (0, 'injector', 400, 1.0),
    (900, 'injector', 0, 1.0),
    (900, 'control2', 400, 0.0),
    (900, 'producer', -300, 0.0),
)


@pytest.fixture(scope='module')
def injecting(tmp_path_factory):
    """Tracer from one well alone: a denser sand looks as a pump that delivers more."""
    folder = tmp_path_factory.mktemp('injecting') / 'injecting'
    return recorded(folder, DENSER, told=told((0, 'injector', 450, 1.0)), duration=2160)


@pytest.fixture(scope='module')
def chasing(tmp_path_factory):
    """The same sand; another well drives the tracer on."""
    folder = tmp_path_factory.mktemp('chasing') / 'chasing'
    return recorded(folder, DENSER, told=CHASE, duration=2160, seed=4)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_second_recording_separates_what_one_cannot(injecting, chasing, tmp_path):
    alone = diagnose(injecting, tmp_path / 'alone', excluded=BESIDE_THE_POINT).summary
    assert {alone['verdict'], *alone['not_separable_from']} >= {'porosity', 'rate'}
    both = [str(injecting), str(chasing)]

    said = diagnose(both, tmp_path / 'both', excluded=BESIDE_THE_POINT).summary
    assert said == json.loads((tmp_path / 'both' / 'diagnosis.json').read_text())
    assert said['verdict'] == 'porosity'
    assert 'rate' not in said['not_separable_from']
    factor = said['effects'][0]['parameters']['factor']
    assert factor['low'] <= factor['value'] <= factor['high']
    assert factor['value'] == pytest.approx(0.88, abs=0.01)

    assert [part['recording'] for part in said['by_recording']] == both
    for number, part in enumerate(said['by_recording']):
        assert part['after'] < 0.5 * part['before']
        assert part['gap_closed_low'] <= part['gap_closed'] <= part['gap_closed_high']
        name = ('fields.nc', 'fields_2.nc')[number]
        with netCDF4.Dataset(tmp_path / 'both' / name) as fields:
            observed = fields['observed'][:]
            error = np.linalg.norm(fields['predicted_after'][:] - observed)
            assert fields['gap'].shape == fields['remainder'].shape == observed.shape[1:]
        assert error / np.linalg.norm(observed) == pytest.approx(part['after'], rel=0.01)
    assert {phase['recording'] for phase in said['when']} == set(both)
    assert said['error']['gap_closed'] > 0.9


def test_the_gap_of_several_recordings_is_mapped_together_and_each_by_itself(injecting, tmp_path):
    other = recorded(tmp_path / 'other', DENSER, told=CHASE, duration=2160, grid=SMALL.grid(84, 50))
    recordings = [open_recording(injecting), open_recording(other)]
    together = map_gap(*recordings)
    for recording, strength in zip(recordings, together.each, strict=True):
        np.testing.assert_allclose(strength, map_gap(recording).strength)
    assert together.strength.shape == recordings[0].grid.shape
    assert sum(phase.share for phase in together.phases) == pytest.approx(1.0, abs=0.01)
    assert {(phase.recording, phase.state) for phase in together.phases} == {
        (0, 'injecting'),
        (1, 'injecting'),
        (1, 'chasing'),
    }
    assert np.hypot(together.spots[0].x - 0.235, together.spots[0].z - 0.235) < 0.15


def test_rigs_that_are_described_differently_are_not_judged_together(injecting, tmp_path):
    other = tmp_path / 'tuesday'
    shutil.copytree(injecting, other)
    text = (other / 'rig.yaml').read_text()
    changed = SMALL.model_copy(update={'porosity': 0.9 * SMALL.porosity})
    write_rig(changed, other / 'rig.yaml')
    assert (other / 'rig.yaml').read_text() != text
    with pytest.raises(InputError, match=r'tuesday: its rig is not described as .* --rig'):
        diagnose([injecting, other], tmp_path / 'out')
