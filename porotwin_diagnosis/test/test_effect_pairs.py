"""Pairs of effects: their bases and their gains."""

import numpy as np
import pytest
from diagnosis_examples import candidate, fit_of, sample_of

from porotwin_diagnosis.search.effect_pairs import (
    judged_pairs,
    linear_gain,
    pair_bases,
)
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import BEAM

SCREENED = [
    fit_of(name, misfit=misfit)
    for name, misfit in (
        ('registration', 2.0),
        ('background_flow', 2.1),
        ('leak', 2.1),
        ('buoyancy', 2.2),
        ('dispersion', 2.4),
        ('clock', 9.0),
    )
]


def levels_of(recording):
    return make_levels([sample_of(recording)], progress=lambda _stage, _share: None)


def base_names(best):
    bases, with_all_partners = pair_bases(fit_of(best, misfit=1.0), SCREENED)
    return [base.members[0].effect for base in bases], with_all_partners


def test_the_best_judged_effect_is_a_base_whatever_its_rank_on_coarse_cells():
    names, with_all_partners = base_names('dispersion')
    assert names == ['dispersion', 'registration', 'background_flow', 'leak']
    assert with_all_partners == 2


def test_the_best_judged_effect_is_not_a_base_twice():
    names, with_all_partners = base_names('registration')
    assert names == ['registration', 'background_flow', 'leak']
    assert (len(names), with_all_partners) == (BEAM, 1)


def test_a_judged_effect_that_was_not_screened_is_no_base():
    assert base_names('retardation') == (['registration', 'background_flow', 'leak'], 2)


def test_a_search_that_finds_no_pairs_goes_on_without(quiet):
    levels = levels_of(quiet)
    porosity = candidate(levels.samples, 'porosity')
    only = levels.screening.evaluate((porosity,), np.zeros(1))
    space = SearchSpace((porosity,), ())
    assert judged_pairs(levels, space, [only], only, levels.null()) == (levels, [])


def test_the_linear_gain_is_the_decrease_of_a_linear_least_squares_problem():
    generator = np.random.default_rng(8)
    own, added = generator.standard_normal((2, 3, 4, 5)), generator.standard_normal((1, 3, 4, 5))
    residual = generator.standard_normal((3, 4, 5))

    def least_squares(*responses):
        matrix = np.concatenate(responses).reshape(-1, residual.size).T
        return np.linalg.lstsq(matrix, residual.ravel(), rcond=None)[1][0]

    gain = linear_gain([residual], [own], [added])
    assert gain == pytest.approx(least_squares(own) - least_squares(own, added))
