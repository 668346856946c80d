"""Tests of the findings that several recordings of one rig leave."""

import json
from datetime import UTC, datetime

import pytest
from history_examples import MONDAY, TUESDAY, pump

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.history.past_findings import (
    add_finding,
    described,
    finding_from,
    findings_on,
    prepare_history,
    read_history,
    rig_without_effects,
)

POROSITY = EffectDescription(name='porosity', parameters={'factor': 1.1})


def test_findings_are_kept_by_date_and_a_recording_counts_once(tmp_path):
    assert read_history(tmp_path) == ()
    later, first, again = pump(0.72, TUESDAY), pump(0.5), pump(0.7)
    assert add_finding(tmp_path, later) == add_finding(tmp_path, first) == []
    assert add_finding(tmp_path, again) == [first]
    assert read_history(tmp_path) == (again, later)


def test_a_finding_on_several_recordings_takes_the_place_of_theirs(tmp_path):
    monday, tuesday = pump(0.7, recordings=('mon',)), pump(0.7, TUESDAY, recordings=('tue',))
    both = pump(0.71, TUESDAY, recordings=('mon', 'tue'))
    for one in (monday, tuesday):
        add_finding(tmp_path, one)
    assert add_finding(tmp_path, both) == [monday, tuesday]
    assert add_finding(tmp_path, monday) == []
    assert read_history(tmp_path) == (both,)


def test_a_finding_that_another_call_has_added_stays(tmp_path):
    add_finding(tmp_path, pump(0.7))
    read_history(tmp_path)
    add_finding(tmp_path, pump(0.71, TUESDAY))
    add_finding(tmp_path, pump(0.72, '2026-11-25T10:00:00+00:00'))
    assert len(read_history(tmp_path)) == 3


@pytest.mark.parametrize(
    ('change', 'place'),
    [
        ({'confidence': 1.5}, '0.confidence'),
        ({'probabilities': {'rate': -0.1}}, '0.probabilities.rate'),
        ({'probabilities': {'rate': 'high'}}, '0.probabilities.rate'),
        ({'date': 'yesterday'}, '0'),
        ({'date': '0001-01-01'}, '0'),
        ({'recordings': []}, '0.recordings'),
        ({'causes': [{'effect': 'foo', 'values': {}}]}, '0.causes.0 .*there is no effect foo'),
        ({'rig': None}, '0.rig'),
        ({'verdict': 'witchcraft'}, '0 .*there is no effect witchcraft'),
        ({'named': ['rate', 'foo']}, '0 .*there is no effect foo'),
        ({'probabilities': {'foo': 0.5}}, '0 .*there is no effect foo'),
        ({'surprise': 1}, '0.surprise.*newer version'),
    ],
)
def test_a_damaged_finding_is_refused_with_its_place(tmp_path, change, place):
    row = pump(0.7).model_dump(mode='json')
    (tmp_path / 'belief.json').write_text(json.dumps([{**row, **change}]))
    with pytest.raises(InputError, match=rf'belief\.json: {place}'):
        read_history(tmp_path)


@pytest.mark.parametrize(
    'broken',
    [{'value': '1.1'}, {'low': None}, {'low': 2.0}, {'value': float('nan')}, {'low': -1e308}],
)
def test_a_damaged_value_is_refused(tmp_path, broken):
    row = pump(0.7).model_dump(mode='json')
    row['causes'][0]['values']['factor'].update(broken)
    (tmp_path / 'belief.json').write_text(json.dumps([row]))
    with pytest.raises(InputError, match=r'0\.causes\.0\.values\.factor'):
        read_history(tmp_path)


@pytest.mark.parametrize('text', ['', '{}', '[{', 'null', '[1]'])
def test_a_file_that_is_no_list_of_findings_is_refused(tmp_path, text):
    (tmp_path / 'belief.json').write_text(text)
    with pytest.raises(InputError, match=r'belief\.json: .*name another folder'):
        read_history(tmp_path)


def test_a_folder_that_cannot_hold_a_history_is_refused_before_the_work(tmp_path):
    (tmp_path / 'file').touch()
    for folder in (tmp_path / 'file', tmp_path / 'file' / 'below'):
        with pytest.raises(InputError):
            prepare_history(folder)
    with pytest.raises(InputError, match='names no folder'):
        prepare_history(tmp_path.__class__(''))
    with pytest.raises(InputError, match='name the folder of the findings'):
        prepare_history(tmp_path / 'history' / 'belief.json')
    (tmp_path / 'monday').mkdir()
    (tmp_path / 'monday' / 'rig.yaml').touch()
    with pytest.raises(InputError, match='is a recording'):
        prepare_history(tmp_path / 'monday')
    prepare_history(tmp_path / 'new' / 'folder')
    assert list((tmp_path / 'new' / 'folder').iterdir()) == []


def test_only_findings_on_the_same_description_are_compared(denser, tmp_path):
    rig = denser.recordings[0].rig
    own = pump(0.7, rig=rig_without_effects(rig), effects=described(rig.effects))
    mended = pump(0.99, rig=rig_without_effects(rig), effects=described([POROSITY]))
    assert findings_on(rig, [own, mended], tmp_path) == [own]
    assert findings_on(rig.with_effects([POROSITY]), [own, mended], tmp_path) == [mended]
    with pytest.raises(InputError, match='another rig'):
        findings_on(rig, [own, pump(0.7)], tmp_path)


def test_the_finding_of_a_diagnosis_holds_what_cannot_be_told_from_it(denser):
    parameters = {
        'well': {'value': 'injector'},
        'factor': {'value': 0.7, 'low': 0.68, 'high': 0.72},
    }
    summary = {
        'verdict': 'rate',
        'confidence': 0.97,
        'combination': ['rate'],
        'not_separable_from': ['decay'],
        'effects': [
            {'name': 'rate', 'probability': 0.6, 'parameters': parameters},
            {'name': 'leak', 'probability': 0.01, 'parameters': {}},
            {'name': 'decay', 'probability': 0.3, 'parameters': {}},
        ],
    }
    found = finding_from(summary, denser.recordings, datetime(2026, 11, 23, tzinfo=UTC))
    rate, decay = found.causes
    assert (rate.effect, rate.well, rate.values['factor'].value) == ('rate', 'injector', 0.7)
    assert (decay.effect, decay.values) == ('decay', {})
    assert found.named == ('rate',)
    assert found.probabilities == {'rate': 0.6, 'leak': 0.01, 'decay': 0.3}
    assert found.seconds == datetime.fromisoformat(MONDAY).timestamp() - 36000
