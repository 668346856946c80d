"""Of which effects pairs are made."""

import numpy as np

from porotwin_diagnosis.candidates import Candidate, Knob
from porotwin_diagnosis.fit import Fit
from porotwin_diagnosis.search import PAIR_BASES, _bases


def fit(effect, misfit):
    knobs = (Knob('value', '-', 1.0, 0.1),)
    members = (Candidate(effect, knobs),)
    return Fit(members, np.ones(1), misfit, misfit, 0.1, 0.1, np.zeros((1, 1)))


SCREENED = [
    fit(name, misfit)
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
    bases, thorough = _bases(fit(best, 1.0), SCREENED)
    return [base.members[0].effect for base in bases], thorough


def test_the_effect_that_was_judged_best_is_a_base_wherever_coarse_cells_put_it():
    bases, thorough = names('dispersion')
    assert bases == ['dispersion', 'registration', 'background_flow', 'leak']
    assert thorough == 2


def test_the_first_of_the_screened_effects_needs_no_second_turn():
    bases, thorough = names('registration')
    assert bases == ['registration', 'background_flow', 'leak']
    assert (len(bases), thorough) == (PAIR_BASES, 1)


def test_an_effect_that_was_not_screened_again_leaves_the_bases_as_they_are():
    assert names('retardation') == (['registration', 'background_flow', 'leak'], 2)
