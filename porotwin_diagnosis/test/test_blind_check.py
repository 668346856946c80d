"""The blind check: sealed truths, drawn reproducibly, scored honestly."""

import json
from dataclasses import replace

import pytest

from porotwin_core.errors import InputError
from porotwin_diagnosis import blind_check
from porotwin_diagnosis.blind_cases import draw_case
from porotwin_diagnosis.blind_check import Score, calibration_error, score_case, summary, table


def test_cases_are_drawn_reproducibly_and_of_every_kind():
    drawn = [draw_case(number, 1) for number in range(60)]
    assert [case.effects for case in drawn] == [draw_case(n, 1).effects for n in range(60)]
    assert {case.kind for case in drawn} == {'none', 'outside', 'left out', 'pair', 'single'}
    for case in drawn:
        if case.kind == 'left out':
            assert case.effects[0].name in case.withheld
        if case.kind == 'outside':
            assert case.right[0] == 'unexplained'


def said(tmp_path, verdict, confidence, combination=()):
    tmp_path.mkdir(exist_ok=True)
    effects = [{'name': name, 'parameters': {}} for name in combination]
    content = {
        'verdict': verdict,
        'confidence': confidence,
        'combination': list(combination),
        'effects': effects,
        'error': {'gap_closed': 0.9},
        'where': {'centre': None},
        'made_with': {'seconds': 60.0},
    }
    (tmp_path / 'diagnosis.json').write_text(json.dumps(content))
    return tmp_path


def test_scores_tell_right_from_sure_and_wrong(tmp_path):
    none = next(c for c in (draw_case(n, 1) for n in range(20)) if c.kind == 'none')
    right = score_case(none, said(tmp_path / 'a', 'none', 0.9))
    wrong = score_case(none, said(tmp_path / 'b', 'rate', 0.9, ['rate']))
    assert right.right and not wrong.right
    figures = summary([right, wrong])
    assert figures['right'] == 0.5
    assert figures['none_called_a_gap'] == 0.5
    assert figures['sure_and_wrong_name'] == 0.5
    assert '| none | 1 | 1 |' in table([right, wrong], figures)


def test_calibration_error_is_zero_only_when_statements_come_true():
    def scores(confidence, hits, count):
        return [
            Score(
                name='c',
                kind='single',
                truth=('rate',),
                verdict='rate',
                confidence=confidence,
                right=n < hits,
                both_found=None,
                gap_closed=None,
                parameter_errors=(),
                intervals_held=0,
                distance_m=None,
                seconds=60.0,
            )
            for n in range(count)
        ]

    assert calibration_error(scores(0.9, 9, 10)) == pytest.approx(0.0)
    assert calibration_error(scores(0.9, 5, 10)) == pytest.approx(0.4)


def test_a_truth_cannot_be_changed_after_it_was_sealed(tmp_path):
    blind_check._publish_seals(tmp_path, [draw_case(0, 1)], 1)
    blind_check._publish_seals(tmp_path, [draw_case(0, 1), draw_case(1, 1)], 1)
    with pytest.raises(InputError, match='another truth'):
        blind_check._publish_seals(tmp_path, [draw_case(0, 2)], 2)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_check_goes_on_where_it_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(
        blind_check, 'draw_case', lambda number, seed: replace(draw_case(number, seed), cell_m=0.01)
    )
    first = blind_check.blind_check(tmp_path, cases=1)
    stamp = (tmp_path / 'case_000' / 'result' / 'diagnosis.json').stat().st_mtime_ns
    stages = []
    again = blind_check.blind_check(
        tmp_path, cases=1, progress=lambda _done, _all, stage: stages.append(stage)
    )
    assert again == first
    assert stages == ['done']
    assert (tmp_path / 'case_000' / 'result' / 'diagnosis.json').stat().st_mtime_ns == stamp
    assert not list((tmp_path / 'case_000' / 'recording').glob('*truth*'))
    assert first['right'] == 1.0
    assert 'confusion' in (tmp_path / 'report.md').read_text().lower()
