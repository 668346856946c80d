"""Tests of the findings that several recordings of one rig leave."""

from dataclasses import replace

import pytest

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.rig_history import (
    PastFinding,
    Value,
    belief,
    compared,
    finding_from,
    prior_from,
    read_history,
    write_history,
)

MONDAY, TUESDAY = '2026-11-23T10:00:00+00:00', '2026-11-24T10:00:00+00:00'


def found(factor, date=MONDAY, width=0.04, **others):
    value = Value('rate', 'injector', 'factor', factor, factor - width / 2, factor + width / 2)
    return PastFinding(date, f'run of {date}', 'rate', 0.97, (value,), **others)


def test_findings_are_kept_and_a_recording_counts_once(tmp_path):
    folder = tmp_path / 'history'
    assert read_history(folder) == ()
    findings = (found(0.7), found(0.72, TUESDAY))
    write_history(folder, [findings[1], found(0.5), findings[0]])
    assert read_history(folder) == findings


def test_a_damaged_file_is_refused_with_one_line(tmp_path):
    (tmp_path / 'belief.json').write_text('[{"date": 1}]')
    with pytest.raises(InputError, match=r'belief\.json: damaged'):
        read_history(tmp_path)


def test_the_belief_is_the_mean_by_precision_and_narrower_than_each():
    (value,) = belief([found(0.7, width=0.02), found(0.76, TUESDAY, width=0.04)]).values()
    assert value.value == pytest.approx((4 * 0.7 + 0.76) / 5)
    assert value.high - value.low < 0.02


def test_a_second_finding_that_agrees_is_no_drift():
    (line,) = compared([found(0.7)], found(0.71, TUESDAY))
    assert line == (
        'rate injector factor: 0.71 now; believed before: 0.7 (0.68 to 0.72); '
        'together: 0.705 (0.691 to 0.719)'
    )


def test_a_difference_beyond_the_intervals_is_a_drift_with_its_rate():
    lines = compared([found(0.7)], found(0.8, TUESDAY))
    assert lines[1] == 'rate injector factor drifts: 0.7 on 2026-11-23, 0.8 now, 0.1 a day'


def test_causes_that_come_and_go_are_told():
    assert 'the first belief' in compared([], found(0.7))[0]
    gone = PastFinding(TUESDAY, 'run', 'none', 0.9)
    assert compared([found(0.7)], gone) == ['rate, found on 2026-11-23, is not there any more']
    named = PastFinding(MONDAY, 'run', 'rate', 0.9)
    assert compared([named], found(0.7, TUESDAY)) == []
    leak = replace(gone, verdict='leak', values=(Value('leak', '', 'rate', 9.0, 8.0, 10.0),))
    assert compared([found(0.7)], leak) == ['leak: new; no earlier recording showed it']


def test_the_finding_of_a_diagnosis_has_the_date_of_its_recording(tmp_path):
    parameters = {
        'well': {'value': 'injector'},
        'factor': {'value': 0.7, 'low': 0.68, 'high': 0.72},
    }
    summary = {
        'verdict': 'rate',
        'confidence': 0.97,
        'combination': ['rate'],
        'effects': [
            {'name': 'rate', 'probability': 0.97, 'parameters': parameters},
            {'name': 'leak', 'probability': 0.01, 'parameters': {}},
        ],
    }
    finding = finding_from(summary, tmp_path)
    (value,) = finding.values
    assert value.key == ('rate', 'injector', 'factor')
    assert (value.value, value.low, value.high) == (0.7, 0.68, 0.72)
    assert finding.probabilities == {'rate': 0.97, 'leak': 0.01}
    assert finding.seconds == pytest.approx(tmp_path.stat().st_mtime, abs=1.0)
    with pytest.raises(InputError, match='name a recording that exists'):
        finding_from(summary, tmp_path / 'nowhere')


def injector(factor):
    return (EffectDescription(name='rate', parameters={'well': 'injector', 'factor': factor}),)


def test_the_next_recording_expects_the_cause_that_was_found_at_its_size():
    prior = prior_from([found(0.7)])
    expected, other_size = prior.weight(injector(0.71)), prior.weight(injector(1.2))
    unknown = prior.weight((EffectDescription(name='leak', parameters={'rate': 9.0}),))
    assert expected > 50 * unknown
    assert other_size == pytest.approx(unknown, rel=0.01)
    assert prior.weight(()) == pytest.approx(unknown)


def test_no_gap_on_monday_is_expected_on_tuesday():
    prior = prior_from([PastFinding(MONDAY, 'run', 'none', 0.9)])
    assert prior.weight(()) > 50 * prior.weight(injector(0.7))


@pytest.mark.parametrize('earlier', [[], [PastFinding(MONDAY, 'run', 'unexplained', 0.9)]])
def test_without_a_cause_nothing_is_expected(earlier):
    prior = prior_from(earlier)
    assert prior.weight(()) == prior.weight(injector(0.7)) == 1.0
