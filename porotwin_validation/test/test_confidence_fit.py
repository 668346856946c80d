"""The fit of a map from stated confidences to observed frequencies."""

import json

import numpy as np
import pytest

from porotwin_validation.confidence_fit import (
    IDENTITY,
    IN_USE,
    ConfidenceMap,
    fit_confidence_map,
    fit_to_scores,
    judged_map,
    mapped,
    taken_back,
)


def test_true_confidences_stay_and_too_high_ones_are_lowered():
    generator = np.random.default_rng(8)
    stated = generator.uniform(0.55, 0.98, 2000)
    as_stated = generator.random(2000) < stated
    scale, shift = fit_confidence_map(stated, as_stated)
    assert scale == pytest.approx(1.0, abs=0.15)
    assert shift == pytest.approx(0.0, abs=0.15)
    less_often = generator.random(2000) < 0.5 + 0.5 * (stated - 0.5)
    assert fit_confidence_map(stated, less_often).scale < 0.8


def test_a_few_lucky_cases_prove_little():
    scale, shift = fit_confidence_map([0.9] * 4, [True] * 4)
    assert scale < 1.2
    assert shift < 0.3


def test_the_map_is_fitted_to_the_scores_of_blind_checks(tmp_path):
    paths = [tmp_path / 'first.json', tmp_path / 'second.json']
    for path in paths:
        cases = [{'confidence': 0.95, 'right': n % 2 == 0} for n in range(20)]
        path.write_text(json.dumps({'cases': cases}))
    found = fit_to_scores(paths)
    assert mapped(found.fitted, [0.95])[0] == pytest.approx(0.5, abs=0.1)
    assert found.cases == 40
    assert found.kept == IN_USE, 'too few cases'


def test_a_map_is_kept_only_where_it_is_better_on_cases_that_it_has_not_seen():
    generator = np.random.default_rng(3)
    stated = generator.uniform(0.8, 0.99, 400)
    wrong = judged_map(stated, generator.random(400) < 0.6)
    assert wrong.kept == wrong.fitted != IN_USE
    assert wrong.error_fitted < 0.4 * wrong.error_in_use
    few = judged_map(stated[:40], generator.random(40) < 0.6)
    assert few.kept == IN_USE


def test_the_map_of_a_file_is_taken_back(tmp_path):
    used = ConfidenceMap(1.3, 0.4)
    of_rules = np.array([0.4, 0.7, 0.9])
    assert taken_back(used, mapped(used, of_rules)) == pytest.approx(of_rules)
    files = []
    for name, stated_with in (('identity', IDENTITY), ('other', used)):
        stated = mapped(stated_with, of_rules).tolist()
        cases = [
            {'confidence': value, 'right': bool(rule > 0.5)}
            for value, rule in zip(stated, of_rules, strict=True)
        ]
        path = tmp_path / f'{name}.json'
        path.write_text(json.dumps({'cases': cases, 'confidence_map': stated_with}))
        files.append(path)
    first, second = (fit_to_scores([path]) for path in files)
    assert first.fitted == pytest.approx(second.fitted, abs=1e-3)
