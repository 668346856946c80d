"""The scan for onsets, and a diagnosis of a camera that was knocked during the recording."""

import pytest
from diagnosis_examples import all_but, recorded, sample_of

from lab.blind.blind_cases import SMALL
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.examine import DiagnosisSettings, judge
from porotwin_diagnosis.model.library import beginnings
from porotwin_diagnosis.progress import no_progress
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.onset_scan import begun, fits_with_onsets
from porotwin_recording.experiment.recording import open_recording

GRID = SMALL.grid(62, 37)
"""Cells of the maps."""

KNOCKED = EffectDescription(
    name='registration', parameters={'dx': 0.008, 'dz': -0.006, 'since': 1000.0}
)
"""A camera that moves by a centimetre after a third of the recording."""

DROPPING = EffectDescription(
    name='rate', parameters={'well': 'injector', 'factor': 0.6, 'since': 700.0}
)
"""A pump that loses two fifths of its rate."""


@pytest.fixture(scope='module')
def dropping(tmp_path_factory):
    """The recording of a pump that drops."""
    return recorded(tmp_path_factory.mktemp('dropping') / 'recording', DROPPING, grid=GRID)


def test_a_pump_that_drops_is_found_with_its_onset(dropping) -> None:
    sample = sample_of(dropping)
    levels = make_levels([sample], progress=no_progress)
    pumps = [one for one in beginnings([sample]) if one.effect == 'rate']
    best, *_ = fits_with_onsets(levels, pumps)
    found = best.effects[0].parameters
    assert best.label == 'rate injector from a time on'
    assert found['since'] == pytest.approx(700.0, abs=0.03 * sample.duration)
    assert found['factor'] == pytest.approx(0.6, abs=0.05)


def test_only_one_recording_has_onsets(dropping) -> None:
    samples = [sample_of(dropping)] * 2
    levels = make_levels(samples, progress=no_progress)
    assert fits_with_onsets(levels, beginnings(samples)) == []


def test_only_an_effect_of_the_rig_has_its_onset_fitted(dropping) -> None:
    sample = sample_of(dropping)
    for candidate in beginnings([sample]):
        one = begun(sample, candidate, 600.0)
        names = [parameter.name for parameter in one.parameters]
        assert one.described(one.first).parameters['since'] == 600.0
        assert ('since' in names) == ('since' not in one.fixed) == ('well' in candidate.fixed)


@pytest.mark.slow
def test_a_knocked_camera_is_named_with_its_onset(tmp_path) -> None:
    recording = open_recording(recorded(tmp_path / 'recording', KNOCKED, grid=GRID))
    settings = DiagnosisSettings(excluded=all_but('registration', 'illumination', 'porosity'))
    verdict = judge([recording], settings).verdict
    (found,) = verdict.model.effects
    assert verdict.members == ('registration',)
    assert found.parameters['since'] == pytest.approx(1000.0, abs=90.0)
    assert found.parameters['dx'] == pytest.approx(0.008, abs=0.001)
