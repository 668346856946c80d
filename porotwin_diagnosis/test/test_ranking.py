"""Which fits are more plausible, and which go on."""

import numpy as np

from porotwin_diagnosis.candidates import Candidate, Knob
from porotwin_diagnosis.fit import Fit
from porotwin_diagnosis.ranking import beyond_noise, excess, near, ranked


def fit(names, fitted, held_out=None, **others):
    knobs = (Knob('value', '-', 1.0, 0.1),)
    members = tuple(Candidate(name, knobs) for name in names.split())
    held_out = fitted if held_out is None else held_out
    size = len(members)
    return Fit(members, np.ones(size), fitted, held_out, 0.1, 0.1, np.zeros((size, size)), **others)


def test_fits_are_ranked_by_the_part_where_more_is_left():
    even, adapted = fit('porosity', 0.6), fit('decay', 0.2, 0.7)
    assert ranked([adapted, even]) == [even, adapted]


def test_what_was_fitted_twice_is_listed_once_with_the_better_fit():
    worse, better, turned = (
        fit(names, left)
        for names, left in (('porosity decay', 2.0), ('porosity decay', 1.0), ('decay porosity', 2))
    )
    other = fit('porosity', 3.0)
    assert ranked([worse, other, better, turned]) == [better, other]


def test_a_second_effect_must_earn_its_place():
    alone, pair = fit('porosity', 1.0), fit('porosity decay', 0.95)
    assert ranked([pair, alone]) == [alone, pair]
    closer = fit('porosity decay', 0.9)
    assert ranked([alone, closer]) == [closer, alone]


def test_only_fits_near_the_best_go_on_but_the_second_in_any_case():
    fits = [fit('decay', left) for left in (1.0, 1.4, 1.45, 1.6)]
    assert near(fits) == fits[:3]
    assert near([fits[0], fits[3]]) == [fits[0], fits[3]]
    assert near([]) == []


def test_what_is_left_beyond_the_noise_is_less_of_a_model_that_may_leave_more():
    plain, viscous = (fit(name, 2.0, noise=(1.0, 1.0)) for name in ('porosity', 'viscosity'))
    assert beyond_noise(plain) == beyond_noise(viscous)
    assert excess(viscous) < excess(plain) == max(beyond_noise(plain))
    assert excess(fit('porosity', 1.0, noise=(1.0, 1.0))) == 0.0
    rough = fit('viscosity', 2.0, noise=(1.0, 1.0), magnified=(2.0, 2.0))
    assert excess(rough) == excess(viscous) / 2.0
