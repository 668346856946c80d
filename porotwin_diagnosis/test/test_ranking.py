"""Which fits are more plausible, and which go on."""

from diagnosis_examples import fit_of

from porotwin_diagnosis.search.ranking import misfit_beyond_noise, near, normalised_misfit, ranked


def test_fits_are_ranked_by_the_part_where_more_is_left():
    even, adapted = fit_of('porosity', misfit=0.6), fit_of('decay', misfit=0.2, held_out=0.7)
    assert ranked([adapted, even]) == [even, adapted]


def test_what_was_fitted_twice_is_listed_once_with_the_better_fit():
    worse, better, turned = (
        fit_of(*names.split(), misfit=left)
        for names, left in (('porosity decay', 2.0), ('porosity decay', 1.0), ('decay porosity', 2))
    )
    other = fit_of('porosity', misfit=3.0)
    assert ranked([worse, other, better, turned]) == [better, other]


def test_a_second_effect_must_earn_its_place():
    alone, pair = fit_of('porosity', misfit=1.0), fit_of('porosity', 'decay', misfit=0.95)
    assert ranked([pair, alone]) == [alone, pair]
    closer = fit_of('porosity', 'decay', misfit=0.9)
    assert ranked([alone, closer]) == [closer, alone]


def test_only_fits_near_the_best_go_on_but_the_second_in_any_case():
    fits = [fit_of('decay', misfit=left) for left in (1.0, 1.4, 1.45, 1.6)]
    assert near(fits) == fits[:3]
    assert near([fits[0], fits[3]]) == [fits[0], fits[3]]
    assert near([]) == []


def test_what_is_left_beyond_the_noise_is_less_of_a_model_that_may_leave_more():
    plain, viscous = (
        fit_of(name, misfit=2.0, noise=(1.0, 1.0)) for name in ('porosity', 'viscosity')
    )
    assert misfit_beyond_noise(plain) == misfit_beyond_noise(viscous)
    assert normalised_misfit(viscous) < normalised_misfit(plain) == max(misfit_beyond_noise(plain))
    assert normalised_misfit(fit_of('porosity', misfit=1.0, noise=(1.0, 1.0))) == 0.0
    rough = fit_of('viscosity', misfit=2.0, noise=(1.0, 1.0), fingering_amplification=(2.0, 2.0))
    assert normalised_misfit(rough) == normalised_misfit(viscous) / 2.0
