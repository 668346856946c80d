"""Of which effects pairs are made, and what becomes of them."""

import numpy as np
from diagnosis_examples import fit_of, recorded

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.search.effect_pairs import BASES, PairSearch, bases_of
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import score
from porotwin_diagnosis.search.single_effects import Singles
from porotwin_recording.recording import open_recording


def search_of(recording):
    sample = read_sample(open_recording(recording))
    levels = Levels([sample], progress=lambda _stage, _share: None, workers=1)
    return levels, PairSearch(levels, Singles(levels, ()))


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


def names(best):
    bases, thorough = bases_of(fit_of(best, misfit=1.0), SCREENED)
    return [base.members[0].effect for base in bases], thorough


def test_the_effect_that_was_judged_best_is_a_base_wherever_coarse_cells_put_it():
    bases, thorough = names('dispersion')
    assert bases == ['dispersion', 'registration', 'background_flow', 'leak']
    assert thorough == 2


def test_the_first_of_the_screened_effects_needs_no_second_turn():
    bases, thorough = names('registration')
    assert bases == ['registration', 'background_flow', 'leak']
    assert (len(bases), thorough) == (BASES, 1)


def test_an_effect_that_was_not_screened_again_leaves_the_bases_as_they_are():
    assert names('retardation') == (['registration', 'background_flow', 'leak'], 2)


def test_a_pair_exchanges_its_members_one_after_the_other(tmp_path):
    """Neither member of the first pair is true: each makes way in its turn."""
    recording = recorded(
        tmp_path / 'recording',
        EffectDescription(name='decay', parameters={'rate': 2e-4}),
        EffectDescription(name='porosity', parameters={'factor': 1.06}),
        duration=1500,
    )
    levels, pairs = search_of(recording)
    levels.screening = levels.judging  # so small a rig has no cells to spare
    known = {candidate.label: candidate for candidate in library(levels.samples)}
    names = ('decay', 'porosity', 'clock', 'illumination')
    screened = [levels.screening.evaluate((known[n],), np.array(known[n].first)) for n in names]
    pair = levels.screening.fit((known['clock'], known['illumination']))
    found = pairs.exchanged({frozenset(('clock', 'illumination')): pair}, screened)
    best = min(found.values(), key=score)
    assert {member.effect for member in best.members} == {'decay', 'porosity'}
    assert score(best) < 0.6 * score(pair)


def test_a_search_that_finds_no_pairs_goes_on_without(quiet, monkeypatch):
    levels, pairs = search_of(quiet)
    null = levels.null()
    monkeypatch.setattr(pairs, '_screened', lambda screened, best: [])
    assert pairs.evaluate([], null, null) == []
