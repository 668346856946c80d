"""The order of fits, and the selection of the fits that go on."""

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.search.ranking import (
    close_to_best,
    earns_its_place,
    first_of_each_effect,
    lack_of_fit,
    larger_misfit,
    log_odds_against,
    may_need_a_second_effect,
    misfit_beyond_noise,
    normalised_misfit,
    overall_misfit,
    ranked,
    score,
)


def test_the_score_is_the_root_mean_square_of_both_parts():
    fit = fit_of('porosity', misfit=1.0, held_out=7.0)
    assert score(fit) == overall_misfit(1.0, 7.0) == 5.0
    assert larger_misfit(fit) == 7.0


def test_fits_are_ranked_by_the_part_with_the_larger_misfit():
    even, adapted = fit_of('porosity', misfit=0.6), fit_of('decay', misfit=0.2, held_out=0.7)
    assert ranked([adapted, even]) == [even, adapted]


def test_of_two_fits_of_the_same_effects_the_better_one_is_ranked():
    worse, better, reversed_order = (
        fit_of(*names.split(), misfit=misfit)
        for names, misfit in (
            ('porosity decay', 2.0),
            ('porosity decay', 1.0),
            ('decay porosity', 2),
        )
    )
    other = fit_of('porosity', misfit=3.0)
    assert ranked([worse, other, better, reversed_order]) == [better, other]


def test_fits_close_to_the_best_go_on_and_the_second_in_any_case():
    fits = [fit_of('decay', misfit=misfit) for misfit in (1.0, 1.4, 1.45, 1.9)]
    assert close_to_best(fits) == fits[:3]
    assert close_to_best([fits[0], fits[3]]) == [fits[0], fits[3]]
    assert close_to_best([]) == []


def test_the_normalised_misfit_is_smaller_if_the_true_effect_may_leave_more():
    plain, viscous = (
        fit_of(name, misfit=2.0, noise=(1.0, 1.0)) for name in ('porosity', 'viscosity')
    )
    assert misfit_beyond_noise(plain) == misfit_beyond_noise(viscous)
    assert normalised_misfit(viscous) < normalised_misfit(plain) == max(misfit_beyond_noise(plain))
    assert normalised_misfit(fit_of('porosity', misfit=1.0, noise=(1.0, 1.0))) == 0.0


def test_the_first_fit_of_every_effect_is_kept():
    fits = [fit_of(name, misfit=1.0) for name in ('decay', 'clock', 'decay')]
    assert first_of_each_effect(fits) == fits[:2]


def test_a_true_model_may_leave_four_hundredths_of_a_large_gap():
    small, large = fit_of(misfit=1.0), fit_of(misfit=100.0)
    model = fit_of('rate', misfit=1.0)
    assert lack_of_fit(model, small) == pytest.approx(1.0 / (0.53**2 + 0.04**2) ** 0.5)
    assert lack_of_fit(model, large) == pytest.approx(1.0 / (0.53**2 + 4.0**2) ** 0.5)


def test_a_further_effect_must_explain_clearly_more_in_both_parts():
    pair = fit_of('rate', 'decay', misfit=2.0)
    assert earns_its_place(fit_of('rate', 'decay', 'clock', misfit=1.5), pair)
    assert not earns_its_place(fit_of('rate', 'decay', 'clock', misfit=1.7), pair)
    adapted = fit_of('rate', 'decay', 'clock', misfit=0.5, held_out=2.1)
    assert not earns_its_place(adapted, pair)


def test_log_odds_are_those_of_a_normal_distribution():
    """A misfit of 0.16 * sqrt(2) beyond the best one is one unit of log-odds."""
    best = 0.5
    further = (best**2 + 2 * 0.16**2) ** 0.5
    assert log_odds_against(further, best) == pytest.approx(1.0)
    assert log_odds_against(0.4, best) == 0.0


def test_pairs_are_looked_for_while_one_effect_leaves_a_gap_however_large_it_was():
    gap, none = fit_of(misfit=50.0), fit_of(misfit=0.4)
    assert may_need_a_second_effect(fit_of('rate', misfit=0.6), gap)
    assert not may_need_a_second_effect(fit_of('rate', misfit=0.5), gap)
    assert not may_need_a_second_effect(fit_of('rate', misfit=0.6), none)
