"""The score of a case: right, imitated, and the errors of its parameters."""

import json
from dataclasses import replace

import pytest
from blind_examples import case_of_kind, stated

from lab.blind.blind_cases import SEVERAL, draw_case
from lab.blind.blind_score import failed_score, relative_parameter_error, score_case
from lab.blind.blind_truth import CaseTruth
from porotwin_solver.effects import EFFECTS


def test_the_right_verdict_is_right_and_another_one_is_wrong(tmp_path):
    none = case_of_kind('none')
    truth = CaseTruth(0.01, 0.02, ('none',))
    right = score_case(none, stated(tmp_path / 'a', 'none', 0.9), truth)
    wrong = score_case(none, stated(tmp_path / 'b', 'rate', 0.9, ['rate']), truth)
    assert right.right and not wrong.right


def test_a_truth_beside_another_name_is_listed(tmp_path):
    case, truth = case_of_kind('single'), CaseTruth(0.2, 0.02, ('depth',))
    alone = score_case(case, stated(tmp_path / 'a', 'porosity', 0.9), truth)
    beside = score_case(case, stated(tmp_path / 'b', 'porosity', 0.9, listed=['depth']), truth)
    assert [score.listed for score in (alone, beside)] == [False, True]
    assert not beside.right


def test_a_name_that_imitates_the_truth_within_the_solver_floor_is_right(tmp_path):
    case = case_of_kind('left out')
    truth = CaseTruth(0.2, 0.02, ('unexplained',))
    said = stated(tmp_path / 'b', 'rate', 0.9)
    scores = [
        score_case(case, stated(tmp_path / 'a', 'unexplained', 0.9), truth),
        score_case(case, said, replace(truth, imitation=0.01)),
        score_case(case, said, replace(truth, imitation=0.03)),
    ]
    assert [score.right for score in scores] == [True, True, False]
    assert [score.imitated for score in scores] == [False, True, False]
    small = replace(truth, before=0.01, imitation=0.01)
    assert not score_case(case, said, small).right, 'there was no gap to explain'


def test_a_failed_diagnosis_is_wrong_with_confidence_zero():
    score = failed_score(case_of_kind('pair'))
    assert (score.verdict, score.right, score.confidence) == ('failed', False, 0.0)
    assert score.all_found is False and score.seconds is None


@pytest.mark.parametrize(
    ('effect', 'name', 'true', 'value', 'error'),
    [
        ('porosity', 'factor', {'factor': 0.9}, 0.92, 0.2),
        ('leak', 'rate', {'rate': -20.0}, -19.0, 0.05),
        ('heterogeneity', 'permeability_factor', {'permeability_factor': 0.1}, 0.2, 0.30103),
        ('well_position', 'dx', {'dx': 3.0, 'dz': 4.0}, 4.0, 0.2),
    ],
)
def test_errors_of_parameters_are_relative_to_the_deviation_from_no_effect(
    effect, name, true, value, error
):
    found = relative_parameter_error(EFFECTS[effect], name, true, value)
    assert found == pytest.approx(error, rel=1e-4)


def test_effects_that_the_calibration_absorbed_need_not_be_found(tmp_path):
    single, pair = case_of_kind('single'), case_of_kind('pair')
    gone = frozenset({single.effects[0].name})
    truth = CaseTruth(0.02, 0.02, single.right)
    said = stated(tmp_path / 'a', 'none', 0.9)
    assert score_case(single, said, truth, gone).right
    assert not score_case(single, said, truth).right
    first, second = (effect.name for effect in pair.effects)
    named = stated(tmp_path / 'b', second, 0.9, [second])
    score = score_case(pair, named, CaseTruth(0.2, 0.02, (first,)), frozenset({first}))
    assert score.right and score.all_found
    assert score.absorbed == (first,)


def test_of_two_alike_both_must_be_found_where_they_are(tmp_path):
    drawn = [draw_case(n, 1, kinds=SEVERAL) for n in range(12)]
    case = next(c for c in drawn if [e.name for e in c.effects] == ['leak', 'leak'])

    def score(folder, *places):
        folder = stated(folder, 'leak', 0.9)
        content = json.loads((folder / 'diagnosis.json').read_text())
        content['combination'] = ['leak' for _ in places]
        content['effects'] = [
            {
                'name': 'leak',
                'parameters': {
                    key: {'value': value, 'low': None, 'high': None}
                    for key, value in (('x', x), ('z', z), ('rate', 20.0))
                },
            }
            for x, z in places
        ]
        (folder / 'diagnosis.json').write_text(json.dumps(content))
        return score_case(case, folder, CaseTruth(0.2, 0.02, ('leak',)))

    first, second = ((e.parameters['x'], e.parameters['z']) for e in case.effects)
    assert score(tmp_path / 'both', second, first).all_found
    assert not score(tmp_path / 'one', first).all_found
    assert not score(tmp_path / 'same', first, first).all_found
