"""The diagnosis as a whole, on recordings of an independent simulator."""

import shutil
from concurrent.futures import CancelledError
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import SMALL, all_but, recorded, schedule

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import ThreadCrew
from porotwin_core.rig import EffectDescription, write_rig
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.progress import SINGLES_JUDGED
from porotwin_diagnosis.report.answer import sentence
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.report_folder import REPORT, write_diagnosis
from porotwin_diagnosis.thresholds import OPEN_CONFIDENCE
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig


def with_a_glare(recording):
    """Return `recording` with one bright cell in all its maps."""
    values = recording.concentration.copy()
    values[:, -2, 1] = 30.0
    maps = replace(recording.present_maps, read=lambda start, stop: values[start:stop])
    return replace(recording, maps=maps)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_diffusive_scheme_is_called_numerical_and_not_dispersion(tmp_path):
    path = recorded(tmp_path / 'recording', grid=SMALL.grid(47, 28))
    recording, told = with_a_glare(open_recording(path)), []
    result = examine(
        [recording],
        DiagnosisSettings(
            preset='upwind', excluded=all_but('dispersion', 'clock'), tell=told.append
        ),
    )
    assert diagnosis_json(result)['remarks'] == told, 'its times are not odd'
    assert any('look for a glare' in line for line in told), 'the diagnosis takes it out'
    assert result.verdict.name == 'numerical_diffusion'
    assert result.evidence.numerics.model_diffusion > 1e-8
    assert diagnosis_json(result)['error']['gap_closed'] > 0.8


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_search_that_is_ended_gives_its_answer_so_far(tmp_path):
    causes = (
        EffectDescription(name='retardation', parameters={'retardation_factor': 1.4}),
        EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.7}),
    )
    path = recorded(tmp_path / 'recording', *causes, grid=SMALL.grid(47, 28))
    stages, told = [], []

    result = examine(
        [open_recording(path)],
        DiagnosisSettings(
            excluded=all_but('retardation', 'rate', 'decay'),
            progress=lambda _stage, position: stages.append(position),
            so_far=told.append,
            ended=lambda: max(stages) >= SINGLES_JUDGED,
        ),
    )
    assert not result.evidence.findings.pairs
    assert len(result.verdict.members) <= 1
    assert result.verdict.confidence <= OPEN_CONFIDENCE
    assert any('before it tried pairs of effects' in line for line in result.remarks)
    assert len(told) >= 2, 'after the first fits, and when they are judged'
    assert all('confidence' in line for line in told)


def test_a_search_that_is_ended_after_its_first_fit_has_a_preliminary_answer(injecting, tmp_path):
    told = []
    with ThreadCrew(2) as crew:
        result = examine(
            [open_recording(injecting)],
            DiagnosisSettings(
                excluded=all_but('rate', 'decay', 'porosity'),
                crew=crew,
                so_far=told.append,
                ended=lambda: bool(told),
            ),
        )
    assert result.evidence.findings.untried.endswith('finer cells, combinations of effects')
    assert result.verdict.confidence <= OPEN_CONFIDENCE
    summary = write_diagnosis(result, tmp_path)
    assert summary['untried'] == result.evidence.findings.untried
    assert sentence(result, summary).startswith('**Preliminary**')
    assert 'The search was ended before' in (tmp_path / REPORT).read_text()


def test_a_search_that_is_ended_at_once_has_no_answer(injecting):
    with pytest.raises(CancelledError):
        examine(
            [open_recording(injecting)],
            DiagnosisSettings(
                excluded=all_but('rate', 'decay'),
                ended=lambda: True,
            ),
        )


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_second_recording_separates_effects_that_one_cannot(injecting, chasing):
    one, two = open_recording(injecting), open_recording(chasing)
    excluded = all_but('porosity', 'rate', 'clock')
    alone = examine([one], DiagnosisSettings(excluded=excluded)).verdict
    assert {alone.name, *alone.inseparable} >= {'porosity', 'rate'}

    both = examine([one, two], DiagnosisSettings(excluded=excluded))
    assert both.verdict.name == 'porosity'
    assert 'rate' not in both.verdict.inseparable
    stated = diagnosis_json(both)
    factor = stated['effects'][0]['parameters']['factor']
    assert factor['low'] <= factor['value'] <= factor['high']
    assert factor['value'] == pytest.approx(0.88, abs=0.01)

    sources = [str(recording.source) for recording in (one, two)]
    assert [part['recording'] for part in stated['by_recording']] == sources
    for stated_part, part in zip(stated['by_recording'], both.held_out, strict=True):
        assert stated_part['after'] < 0.5 * stated_part['before']
        low, high = stated_part['gap_closed_low'], stated_part['gap_closed_high']
        assert low <= stated_part['gap_closed'] <= high
        error = np.linalg.norm(part.after - part.observed) / np.linalg.norm(part.observed)
        assert error == pytest.approx(stated_part['after'], rel=0.01)
    assert {phase['recording'] for phase in stated['when']} == set(sources)
    assert stated['error']['gap_closed'] > 0.9


def test_a_recording_too_short_to_judge_is_refused_in_one_line(tmp_path):
    make_experiment(
        tmp_path / 'short',
        VirtualRig(SMALL),
        commanded=schedule(),
        duration=300,
        photo_interval=60,
        seed=1,
        grid=SMALL.grid(47, 28),
    )
    told = []
    with pytest.raises(InputError, match='too few'):
        examine(
            [with_a_glare(open_recording(tmp_path / 'short'))], DiagnosisSettings(tell=told.append)
        )
    assert any('look for a glare' in line for line in told), 'what is odd may be the reason'


def test_a_preset_that_does_not_exist_is_refused_before_the_search(quiet):
    stages = []
    with pytest.raises(InputError, match="preset 'fats': unknown"):
        examine(
            [open_recording(quiet)],
            DiagnosisSettings(preset='fats', progress=lambda stage, _: stages.append(stage)),
        )
    assert stages == []


def test_rigs_that_are_described_differently_are_not_judged_together(injecting, tmp_path):
    other = tmp_path / 'tuesday'
    shutil.copytree(injecting, other)
    text = (other / 'rig.yaml').read_text()
    changed = SMALL.model_copy(update={'porosity': 0.9 * SMALL.porosity})
    write_rig(changed, other / 'rig.yaml')
    assert (other / 'rig.yaml').read_text() != text
    with pytest.raises(InputError, match=r'tuesday: its rig is not described as .* --rig'):
        examine([open_recording(injecting), open_recording(other)])
