"""Pairs and triples are fitted, judged, and kept if they earn their place."""

import numpy as np
from diagnosis_examples import candidate, fit_of, sample_of

from porotwin_diagnosis.search.effects_together import (
    hopeful,
    judged_together,
    worth_keeping,
)
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import (
    CORRECTED_MISFIT,
    SUFFICIENT_MISFIT,
)


def levels_of(recording):
    return make_levels([sample_of(recording)], progress=lambda _stage, _share: None)


def test_a_search_that_finds_no_pairs_goes_on_without(quiet):
    levels = levels_of(quiet)
    porosity = candidate(levels.samples, 'porosity')
    only = levels.screening.evaluate((porosity,), np.zeros(1))
    space = SearchSpace((porosity,), ())
    assert judged_together(levels, space, [only], levels.null(), 2) == (levels, [])


def test_no_third_effect_is_looked_for_beside_a_pair_that_suffices_or_fails():
    misfits = 0.9 * SUFFICIENT_MISFIT, 1.1 * CORRECTED_MISFIT, 2.0, 1.1 * CORRECTED_MISFIT
    pairs = [[fit_of('rate', 'leak', misfit=misfit)] for misfit in misfits]
    gaps = [fit_of(misfit=misfit) for misfit in (9.0, 9.0, 9.0, 9.0, 30.0)]
    asked = zip([[], *pairs], gaps, strict=True)
    assert [hopeful(*own) for own in asked] == [False] * 3 + [True] * 2


def test_a_triple_is_kept_only_if_it_leaves_clearly_less_than_the_pair():
    pair = fit_of('rate', 'clock', misfit=2.0)
    triples = [fit_of('rate', 'clock', 'decay', misfit=misfit) for misfit in (1.0, 1.9)]
    assert worth_keeping(triples, pair) == triples[:1]
