"""The search space, and single effects on screening cells."""

import math

import pytest
from diagnosis_examples import SLOW_EFFECTS, SMALL, recorded, sample_of

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search import single_effects
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.place_scan import trials_at
from porotwin_diagnosis.search.single_effects import (
    coarsely_fitted_singles,
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


def test_the_true_effect_is_the_first(denser_sand):
    sample = sample_of(denser_sand)
    kept = ('porosity', 'decay', 'saturation')
    excluded = {c.effect for c in library([sample])} - set(kept) | set(SLOW_EFFECTS)
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    screened = all_screened(levels, search_space([sample], excluded))
    assert screened[0].label == 'porosity'
    assert sorted(fit.label for fit in screened) == sorted(kept)


def test_a_zone_that_the_scan_has_missed_is_found_at_the_place_of_a_leak(tmp_path, monkeypatch):
    zone = {'x': 0.24, 'z': 0.3, 'radius': 0.04, 'permeability_factor': 0.15}
    hidden = EffectDescription(name='heterogeneity', parameters=zone)
    sample = sample_of(recorded(tmp_path / 'recording', hidden, grid=SMALL.grid(94, 56)))
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    beside = {'leak': (0.26, 0.28), 'heterogeneity': (0.45, 0.1)}

    def starts(_levels, effect):
        return trials_at(sample, effect, beside[effect])[:1]

    monkeypatch.setattr(single_effects, 'place_starts', starts)
    excluded = {c.effect for c in library([sample])} - {'decay', 'leak', 'heterogeneity'}
    best = all_screened(levels, search_space([sample], excluded))[0]
    assert best.label == 'heterogeneity'
    (found,) = best.effects
    assert math.hypot(found.parameters['x'] - 0.24, found.parameters['z'] - 0.3) < 0.06


def all_screened(levels, space):
    """Return the last fits on screening cells, and check that all others were less."""
    *before, coarse = coarsely_fitted_singles(levels, space)
    assert [len(tried.fits) for tried in before] == list(range(1, len(coarse.fits)))
    assert coarse.left == space.local_effects
    *_, last = screened_singles(levels, space, coarse.fits)
    assert last.left == ()
    return last.fits
