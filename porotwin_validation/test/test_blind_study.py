"""The blind check: sealed truths, drawn reproducibly, scored honestly."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from subprocess import CalledProcessError

import numpy as np
import pytest
from diagnosis_examples import BESIDE_THE_POINT

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.report.diagnosis_json import write_fields
from porotwin_recording.concentration import ConcentrationWriter, open_maps
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_validation import blind_study as blind_check
from porotwin_validation.blind_cases import draw_case
from porotwin_validation.blind_study import (
    Score,
    calibration_error,
    failed_score,
    score_case,
    summary,
    table,
)
from porotwin_validation.blind_truth import Truth, truth_of


def test_cases_are_drawn_reproducibly_and_of_every_kind():
    drawn = [draw_case(number, 1) for number in range(60)]
    assert [case.effects for case in drawn] == [draw_case(n, 1).effects for n in range(60)]
    assert {case.kind for case in drawn} == {'none', 'outside', 'left out', 'pair', 'single'}
    for case in drawn:
        if case.kind == 'left out':
            assert case.effects[0].name in case.withheld
        if case.kind == 'outside':
            assert case.right[0] == 'unexplained'


def clean_maps(path, case, times):
    """Write and return what the virtual rig truly shows at `times`, without noise."""
    grid = case.rig.default_grid(case.cell_m)
    rig = VirtualRig(case.rig, effects=case.effects)
    with ConcentrationWriter(path, grid) as writer:
        for time, signal in signals(rig, case.schedule, times=times, grid=grid):
            writer.append(time, signal)
    return np.asarray(open_maps(path, case.rig)[:], dtype=float)


def said(tmp_path, verdict, confidence, combination=(), parameters=()):
    tmp_path.mkdir(exist_ok=True)
    values = {key: {'value': value} for key, value in parameters}
    effects = [{'name': name, 'parameters': values} for name in combination]
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
    truth = Truth(0.01, 0.02, ('none',))
    right = score_case(none, said(tmp_path / 'a', 'none', 0.9), truth)
    wrong = score_case(none, said(tmp_path / 'b', 'rate', 0.9, ['rate']), truth)
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
                imitated=False,
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


def test_of_a_pair_only_the_stronger_effect_is_right(tmp_path):
    effects = (
        EffectDescription(name='decay', parameters={'rate': 2e-5}),
        EffectDescription(name='depth', parameters={'factor_centre': 1.3}),
    )
    case = replace(
        draw_case(4, 1), effects=effects, right=('decay', 'depth'), duration=900.0, cell_m=0.01
    )
    grid = case.rig.default_grid(case.cell_m)
    times = [300.0, 600.0, 900.0]
    nothing = clean_maps(tmp_path / 'nothing.nc', replace(case, effects=()), times)[1:]
    everything = clean_maps(tmp_path / 'clean.nc', case, times)[1:]
    held_out = HeldOut(np.array(times[1:]), everything, nothing, everything, 0.1, 0.0, 0.0)
    write_fields(tmp_path / 'fields.nc', grid, everything[0], held_out)
    said(tmp_path, 'decay', 0.9, ['decay'], [('rate', 2e-5)])
    truth_of(case, tmp_path, tmp_path / 'clean.nc').write(tmp_path / 'truth.json')
    truth = Truth.read(tmp_path / 'truth.json')
    assert truth.strongest == ('depth',)
    assert truth.before > 0.03 > truth.after == 0.0
    assert truth.imitation is None, 'a member of the pair has no need to imitate it'
    assert truth.gap_closed == pytest.approx(truth.before / (truth.before - 0.02), rel=1e-3)
    said(tmp_path, 'decay', 0.9, ['decay', 'depth'])
    score = score_case(case, tmp_path, truth)
    assert not score.right
    assert score.both_found


def test_what_shows_the_same_as_an_effect_left_out_is_no_wrong_name(tmp_path):
    """A bulge of a few per cent is a lower porosity to the camera; a late clock is not."""
    bulge = EffectDescription(name='depth', parameters={'factor_centre': 0.95})
    case = replace(
        draw_case(4, 1),
        kind='left out',
        effects=(bulge,),
        right=('unexplained',),
        withheld=('depth',),
        duration=900.0,
        cell_m=0.01,
    )
    grid = case.rig.default_grid(case.cell_m)
    times = np.array([600.0, 900.0])
    maps = clean_maps(tmp_path / 'clean.nc', case, times)
    scores = {}
    for name, parameter, value in (
        ('porosity', 'factor', 0.967),
        ('clock', 'offset', 200.0),
        ('retardation', 'retardation_factor', -1.0),
    ):
        place = said(tmp_path / name, name, 0.9, [name], [(parameter, value)])
        write_fields(
            place / 'fields.nc', grid, maps[0], HeldOut(times, maps, 0.9 * maps, maps, 0.1, 0, 0)
        )
        truth_of(case, place, tmp_path / 'clean.nc').write(place / 'truth.json')
        scores[name] = score_case(case, place, Truth.read(place / 'truth.json'))
    assert scores['porosity'].right and scores['porosity'].imitated
    assert not scores['clock'].right
    assert not scores['retardation'].right, 'what the virtual rig refuses imitates nothing'


def test_a_small_effect_named_where_none_is_stays_wrong(tmp_path):
    none = next(c for c in (draw_case(n, 1) for n in range(20)) if c.kind == 'none')
    none = replace(none, duration=900.0, cell_m=0.01)
    times = np.array([600.0, 900.0])
    maps = clean_maps(tmp_path / 'clean.nc', none, times)
    place = said(tmp_path / 'said', 'porosity', 0.9, ['porosity'], [('factor', 1.001)])
    grid = none.rig.default_grid(none.cell_m)
    held_out = HeldOut(times, maps, 0.9 * maps, maps, 0.1, 0.0, 0.0)
    write_fields(place / 'fields.nc', grid, maps[0], held_out)
    assert not score_case(none, place, truth_of(none, place, tmp_path / 'clean.nc')).right


def test_what_a_library_effect_equals_is_not_outside_the_library(tmp_path):
    case = next(c for c in (draw_case(n, 1) for n in range(60)) if c.kind == 'left out')
    truth = Truth(0.2, 0.02, ('unexplained',))
    scores = [
        score_case(case, said(tmp_path / 'a', 'unexplained', 0.9), truth),
        score_case(case, said(tmp_path / 'b', 'rate', 0.9), replace(truth, imitation=0.01)),
        score_case(case, said(tmp_path / 'c', 'rate', 0.9), replace(truth, imitation=0.03)),
    ]
    assert [score.right for score in scores] == [True, True, False]
    figures = summary(scores)
    assert figures['outside_called_unexplained'] == 0.5
    assert figures['imitated'] == pytest.approx(1 / 3)
    small = replace(truth, before=0.01, imitation=0.01)
    assert not score_case(case, tmp_path / 'b', small).right, 'there was no gap to explain'


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_check_goes_on_where_it_stopped(tmp_path, monkeypatch):
    def light_case(number, seed):
        return replace(draw_case(number, seed), cell_m=0.01, withheld=BESIDE_THE_POINT)

    monkeypatch.setattr(blind_check, 'draw_case', light_case)
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


def test_a_case_whose_diagnosis_fails_is_wrong_and_the_others_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr(
        blind_check, 'ProcessPoolExecutor', lambda workers, **_: ThreadPoolExecutor(workers)
    )

    def fails(case, _place):
        if case.name == 'case_001':
            raise CalledProcessError(2, 'diagnosis')

    monkeypatch.setattr(blind_check, '_make_and_diagnose', fails)
    drawn = [draw_case(number, 1) for number in range(3)]
    stages = []
    failed = blind_check._work_through(
        tmp_path, drawn, 2, 3, lambda _done, _all, stage: stages.append(stage)
    )
    assert failed == {'case_001'}
    assert sorted(stages) == ['case_000 diagnosed', 'case_001 failed', 'case_002 diagnosed']
    score = failed_score(drawn[1])
    figures = summary([score])
    assert figures['right'] == 0.0
    assert figures['seconds_median'] is None
    assert 'failed' in table([score], figures)
