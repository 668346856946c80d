"""The fit of a map from stated confidences to observed frequencies."""

import json

import numpy as np
import pytest

from lab.blind.confidence_fit import (
    IDENTITY,
    error_by_chance,
    fit_confidence_map,
    fit_to_scores,
    judged_map,
    mapped,
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
    assert found.kept == IDENTITY, 'too few cases'


def test_a_map_is_kept_only_where_it_is_better_on_cases_that_it_has_not_seen():
    generator = np.random.default_rng(3)
    stated = generator.uniform(0.8, 0.99, 400)
    wrong = judged_map(stated, generator.random(400) < 0.6)
    assert wrong.kept == wrong.fitted != IDENTITY
    assert wrong.error_mapped < 0.4 * wrong.error_stated
    few = judged_map(stated[:40], generator.random(40) < 0.6)
    assert few.kept == IDENTITY


def test_chance_alone_makes_an_error_that_falls_with_the_number_of_cases():
    few, many = error_by_chance([0.9] * 25), error_by_chance([0.9] * 2500)
    # the mean distance of a binomial share from 0.9 is 0.8 of its standard deviation
    assert few == pytest.approx(0.8 * 0.06, rel=0.1)
    assert many == pytest.approx(0.1 * few, rel=0.1)
    assert error_by_chance([1.0] * 10) == 0.0
