"""Tests of the finding that the running twin reads from a diagnosis.json."""

import json

import pytest
from mending_examples import finding, notice, weak_pump

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.mending.finding import finding_of, read_finding

SUMMARY = {
    'verdict': 'rate',
    'confidence': 0.96,
    'not_separable_from': ['porosity'],
    'combination': ['rate', 'clock', 'numerical_diffusion'],
    'effects': [
        {
            'name': 'rate',
            'parameters': {'well': {'value': 'injector'}, 'factor': {'value': 0.7, 'low': 0.6}},
        },
        {'name': 'clock', 'parameters': {'offset': {'value': 40.0}}},
        {'name': 'numerical_diffusion', 'parameters': {'model_diffusion': {'value': 1e-8}}},
        {'name': 'decay', 'parameters': {'rate': {'value': 1e-4}}},
    ],
    'error': {'before': 0.24, 'after': 0.03, 'gap_closed': 0.95},
}


def test_effects_of_solver_and_camera_are_told_apart():
    found = finding_of(SUMMARY, 'report.html')
    assert found.effects == (weak_pump(),)
    assert [one.name for one in found.camera] == ['clock']
    assert found.cause == (('clock', ''), ('rate', 'injector'))
    assert not found.doubt(0.9)


def test_the_sentence_names_the_cause_and_the_size_of_the_improvement():
    sentence = finding_of(SUMMARY).sentence
    assert sentence.startswith(
        'Pump injector delivers 70 % of the commanded rate (or porosity, which looks the same): '
        'with it, and with the camera corrected, the model errs by 3 % instead of 24 %. The '
    )
    assert 'photograph the clock of the pumps, then correct the camera' in sentence
    assert 'ask whether the pumps ran before their first known rates' in sentence
    assert '<' not in sentence


@pytest.mark.parametrize(
    ('changed', 'words'),
    [
        ({'confidence': 0.89}, 'rate with confidence 0.89, below 0.9'),
        ({'confidence': 0.8999}, 'rate with confidence 0.89, below 0.9'),
        ({'before': 0.1, 'after': 0.08}, 'closes too little of the gap'),
        ({'before': 0.031, 'after': 0.03}, 'closes too little of the gap'),
    ],
)
def test_an_unsure_or_useless_finding_is_doubted(changed, words):
    assert words in finding(**changed).doubt(0.9)


def test_a_defect_of_the_camera_is_a_notice_with_its_remedy():
    assert not notice().doubt(0.9)
    assert 'The model cannot mend this' in notice().sentence


def test_an_unreadable_diagnosis_is_refused_with_one_line(tmp_path):
    report = tmp_path / 'report.html'
    with pytest.raises(InputError, match=r'diagnosis\.json: No such file'):
        read_finding(report)
    for text in ('{', '{}', '[]'):
        (tmp_path / 'diagnosis.json').write_text(text)
        with pytest.raises(InputError, match=r'diagnosis\.json: no diagnosis'):
            read_finding(report)
    for confidence in (float('nan'), 7.0):
        (tmp_path / 'diagnosis.json').write_text(json.dumps({**SUMMARY, 'confidence': confidence}))
        with pytest.raises(InputError, match=r'confidence .* is not from 0 to 1'):
            read_finding(report)
    (tmp_path / 'diagnosis.json').write_text(json.dumps(SUMMARY))
    assert read_finding(report).report == str(report)
