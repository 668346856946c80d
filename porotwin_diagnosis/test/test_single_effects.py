"""The search space, and single effects on screening cells."""

import pytest
from diagnosis_examples import SLOW_EFFECTS, sample_of

from porotwin_core.errors import InputError
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.ranking import score
from porotwin_diagnosis.search.single_effects import (
    refitted_singles,
    screened_singles,
    search_space,
)


def test_excluded_effects_are_not_in_the_search_space(quiet):
    space = search_space([sample_of(quiet)], ['leak', 'porosity'])
    names = {candidate.effect for candidate in space.candidates}
    assert 'porosity' not in names
    assert {'retardation', 'rate'} < names
    assert space.local_effects == ('heterogeneity',)


def test_a_search_space_without_effects_is_refused(quiet):
    sample = sample_of(quiet)
    names = {candidate.effect for candidate in library([sample])}
    with pytest.raises(InputError, match='excluded'):
        search_space([sample], sorted(names))


def test_the_true_effect_is_among_the_first_and_stays_when_fitted_again(denser_sand):
    sample = sample_of(denser_sand)
    kept = ('porosity', 'decay', 'saturation')
    excluded = {c.effect for c in library([sample])} - set(kept) | set(SLOW_EFFECTS)
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    screened = screened_singles(levels, search_space([sample], excluded))
    assert screened[0].label == 'porosity'
    assert sorted(fit.label for fit in screened) == sorted(kept)
    again = refitted_singles(levels, screened[1], screened)
    assert sorted(fit.label for fit in again) == sorted(kept)
    assert score(again[0]) <= score(screened[0])
