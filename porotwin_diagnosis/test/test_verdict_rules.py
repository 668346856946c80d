"""The verdict as a function of the evidence, and its confidence."""

import math
from dataclasses import replace
from functools import partial

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Doubt
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.search.findings import Findings

NOISE = 0.4
"""Misfit of noise alone in these findings."""

SHARP = Numerics('accurate', 5.0, 5.0)
"""The accurate scheme, whose numerical diffusion is not looked for."""

fit = partial(fit_of, noise=(NOISE, NOISE))


def findings(null, *singles, pairs=(), distances=None, pair_distances=None, parts=()):
    fits = [fit(name, misfit=value) for name, value in singles]
    distances = distances or [0.0] + [3.0] * (len(fits) - 1)
    without = fit(misfit=null)
    return Findings(
        without,
        without,
        fits,
        fits,
        [fit(*names, misfit=m) for names, m in pairs],
        distances,
        pair_distances or [0.0] + [3.0] * (len(pairs) - 1),
        [fit(name, misfit=5.0, error=value) for name, value in parts],
        [1.0 for _ in parts],
    )


def evidence(found, *, numerics=SHARP, cells_along=94, frames=20):
    return Evidence(found, explain(found), numerics, cells_along, frames)


def verdict_on(found, **others):
    return decide(evidence(found, **others))


def test_a_recording_that_the_model_explains_has_no_gap():
    verdict = verdict_on(findings(0.45, ('registration', 0.43), ('rate', 0.44)))
    assert verdict.name == 'none'
    assert verdict.confidence > 0.8
    assert verdict.members == ()


def test_an_effect_that_helps_less_than_chance_is_not_named():
    verdict = verdict_on(findings(0.705, ('illumination', 0.685), ('background_flow', 0.7)))
    assert (verdict.name, verdict.doubt, verdict.members) == ('none', Doubt.NO_GAP, ())
    assert verdict.confidence < 0.6


def test_a_gap_that_only_the_errors_of_all_maps_close_makes_none_unsure():
    found = findings(0.4, ('saturation', 0.38))
    swallowed = replace(found.null, unshared_misfit=(0.9, 1.1))
    assert verdict_on(found).confidence > 0.9
    verdict = verdict_on(replace(found, null=swallowed))
    assert (verdict.name, verdict.confidence) == ('none', 0.5)


def test_errors_of_all_maps_that_are_small_beside_the_effect_do_not_lower_its_confidence():
    found = findings(3.0, ('clock', 0.42), ('rate', 2.0))
    clock, rate = found.singles
    small, large = (replace(clock, unshared_misfit=(u, u)) for u in (0.7, 4.0))
    assert verdict_on(replace(found, singles=[small, rate])).confidence > 0.9
    assert verdict_on(replace(found, singles=[large, rate])).confidence == 0.5


def test_an_effect_that_closes_the_gap_alone_is_named():
    verdict = verdict_on(findings(5.0, ('decay', 0.45), ('illumination', 2.4)))
    assert (verdict.name, verdict.members) == ('decay', ('decay',))
    assert verdict.confidence > 0.8


def test_a_late_clock_that_old_tracer_imitates_is_named_with_doubt():
    late = evidence(findings(5.0, ('clock', 0.45), ('illumination', 2.4)))
    assert decide(late).confidence > 0.8
    verdict = decide(replace(late, may_have_held_tracer=True))
    assert (verdict.name, verdict.doubt, verdict.confidence) == ('clock', Doubt.START, 0.6)
    untouched = evidence(findings(5.0, ('decay', 0.45), ('illumination', 2.4)))
    assert decide(replace(untouched, may_have_held_tracer=True)) == decide(untouched)


def test_a_gap_that_nothing_closes_is_unexplained():
    verdict = verdict_on(findings(6.0, ('rate', 4.0), ('clock', 4.1)))
    assert verdict.name == 'unexplained'
    assert verdict.members == ()


def test_a_gap_is_hardly_unexplained_while_effects_are_untried():
    found = findings(6.0, ('rate', 4.0), ('clock', 4.1))
    whole, ended = verdict_on(found), verdict_on(replace(found, untried='leak'))
    assert whole.name == ended.name == 'unexplained'
    assert whole.confidence > 0.5
    assert ended.confidence < 0.1


def test_the_true_effect_may_leave_more_of_a_large_gap_than_of_a_small_one():
    large = verdict_on(findings(60.0, ('heterogeneity', 0.8), ('leak', 40.0)))
    assert large.name == 'heterogeneity'
    small = verdict_on(findings(6.0, ('heterogeneity', 0.8), ('leak', 4.0)))
    assert small.name == 'unexplained'


def test_two_effects_that_look_the_same_are_declared_inseparable():
    distances = [0.0, 0.01, 0.8]
    found = findings(
        3.0, ('porosity', 0.5), ('retardation', 0.5), ('depth', 0.6), distances=distances
    )
    verdict = verdict_on(found)
    assert verdict.inseparable == ('retardation',)
    assert verdict.confidence > 0.8


def test_another_effect_that_explains_as_well_but_looks_different_lowers_the_confidence():
    distances = [0.0, 0.9]
    verdict = verdict_on(findings(3.0, ('leak', 0.5), ('rate', 0.5), distances=distances))
    assert verdict.inseparable == ()
    assert verdict.confidence < 0.7
    assert verdict.not_separable == ('rate',)


def test_the_confidence_is_that_of_the_named_effect_and_not_of_its_close_rivals():
    distances = [0.0, 0.01, 0.9, 0.9]
    found = findings(
        3.0, ('porosity', 0.5), ('retardation', 0.5), ('depth', 0.52), ('rate', 0.7),
        distances=distances,
    )  # fmt: skip
    verdict = verdict_on(found)
    assert verdict.not_separable == ('retardation', 'depth')
    assert verdict.close == ('depth',)
    assert 0.7 < verdict.confidence < 0.9


def test_a_pair_is_kept_only_when_the_second_effect_earns_its_place():
    alone = (('rate', 1.6), ('saturation', 4.0))
    pairs, parts = [(('saturation', 'rate'), 0.5)], (('saturation', 4.0), ('rate', 1.7))
    pair = verdict_on(findings(6.0, *alone, pairs=pairs, parts=parts))
    assert pair.members == ('rate', 'saturation')
    single = verdict_on(findings(6.0, *alone, pairs=[(('saturation', 'rate'), 1.5)]))
    assert single.members in (('rate',), ())


def test_pairs_that_look_the_same_are_declared():
    pairs = [(('decay', name), 0.5) for name in ('porosity', 'retardation', 'rate')]
    # the same effects again, at another well or as another variant, are no further alternatives
    pairs += [(('retardation', 'decay'), 0.5), (('porosity', 'decay'), 0.5)]
    distances = [0.0, 0.01, 0.4, 0.01, 0.01]
    parts = (('decay', 2.0), ('porosity', 8.0))
    found = findings(9.0, ('decay', 1.7), pairs=pairs, pair_distances=distances, parts=parts)
    verdict = verdict_on(found)
    assert verdict.members == ('decay', 'porosity')
    assert verdict.alternatives == (('decay', 'retardation'),)


def test_a_pair_whose_stronger_effect_is_inseparable_from_another_is_confident_of_both():
    pairs = [(('retardation', 'decay'), 0.3), (('porosity', 'decay'), 0.3)]
    parts = (('retardation', 0.1), ('decay', 0.3))
    found = findings(9.0, ('leak', 2.0), pairs=pairs, pair_distances=[0.0, 0.01], parts=parts)
    found = replace(found, part_changes=[4.0, 2.0])
    verdict = verdict_on(found)
    assert verdict.name == 'retardation'
    assert verdict.inseparable == ('porosity',)
    assert verdict.confidence > 0.9


def test_the_member_of_a_pair_that_leaves_the_smaller_error_comes_first():
    pairs, parts = (
        [(('registration', 'dispersion'), 0.5)],
        (('registration', 0.3), ('dispersion', 0.2)),
    )
    found = findings(9.0, ('leak', 3.0), pairs=pairs, parts=parts)
    found = replace(found, parts=[fit('registration', misfit=3.0, error=0.3), *found.parts[1:]])
    assert verdict_on(found).name == 'dispersion'


def test_an_effect_that_fails_in_the_held_out_part_explains_nothing():
    found = findings(6.0, ('background_flow', 0.45), ('leak', 3.0))
    found = replace(
        found, singles=[fit('background_flow', misfit=0.45, held_out=0.9), *found.singles[1:]]
    )
    assert verdict_on(found).name == 'unexplained'


def test_numerical_diffusion_does_not_make_a_rejected_effect_a_finding():
    smearing = Numerics('upwind', 9.0, 6.0, with_effects=7.0, model_diffusion=1e-8)
    verdict = verdict_on(findings(6.0, ('rate', 4.0), ('clock', 4.1)), numerics=smearing)
    assert verdict.name == 'unexplained'
    assert verdict.members == ()


def test_numerical_diffusion_alone_is_named_where_the_accurate_scheme_leaves_no_gap():
    smearing = Numerics('upwind', 9.0, 0.45, model_diffusion=1e-8)
    verdict = verdict_on(findings(0.45, ('rate', 0.44)), numerics=smearing)
    assert (verdict.name, verdict.members) == ('numerical_diffusion', ('numerical_diffusion',))
    assert verdict.model.members == ()


def test_numerical_diffusion_and_an_effect_are_named_the_stronger_first():
    distances = [0.0, 0.01]
    found = findings(9.0, ('porosity', 0.5), ('depth', 0.5), distances=distances)
    weaker = Numerics('upwind', 9.0, 6.0, with_effects=5.0, model_diffusion=1e-8)
    second = verdict_on(found, numerics=weaker)
    assert (second.name, second.members) == ('porosity', ('porosity', 'numerical_diffusion'))
    stronger = Numerics('upwind', 9.0, 3.0, with_effects=5.0, model_diffusion=1e-8)
    first = verdict_on(found, numerics=stronger)
    assert (first.name, first.members) == (
        'numerical_diffusion',
        ('numerical_diffusion', 'porosity'),
    )
    assert first.inseparable == ()
    assert first.alternatives == (('numerical_diffusion', 'depth'),)


def test_a_scheme_that_smears_little_is_not_named():
    little = Numerics('fast', 9.0, 8.0)
    verdict = verdict_on(findings(9.0, ('porosity', 0.5), ('leak', 4.0)), numerics=little)
    assert verdict.members == ('porosity',)


@pytest.mark.parametrize('misfit', [0.3, 0.6, 2.0, 5.0])
def test_confidence_is_a_probability(misfit):
    verdict = verdict_on(findings(6.0, ('rate', misfit), ('clock', misfit)))
    assert 0.0 < verdict.confidence < 1.0
    assert math.isclose(sum(verdict.probabilities.values()), 1.0)


@pytest.mark.parametrize('scant', [{'cells_along': 79}, {'frames': 3}])
def test_no_verdict_on_a_scant_recording_is_confident(scant):
    clear = findings(5.0, ('decay', 0.45), ('illumination', 2.4))
    unexplained = findings(30.0, ('rate', 20.0), ('clock', 21.0))
    for found in (clear, unexplained, findings(0.41, ('rate', 0.4))):
        assert verdict_on(found).confidence > 0.8
        assert verdict_on(found, **scant).confidence == 0.6
        assert verdict_on(found, **scant).name == verdict_on(found).name


def test_a_pair_is_less_certain_if_one_of_its_effects_nearly_suffices():
    pair = (('well_position', 'depth'), 0.45)
    near = verdict_on(findings(5.0, ('well_position', 0.9), pairs=[pair]))
    far = verdict_on(findings(5.0, ('well_position', 2.0), pairs=[pair]))
    assert near.members == far.members == ('well_position', 'depth')
    assert near.confidence < 0.85 < far.confidence


def test_an_effect_that_leaves_nearly_too_much_is_named_with_a_low_confidence():
    """It may stand for one that the library lacks."""
    little, much = (
        verdict_on(findings(5.0, ('porosity', misfit), ('leak', 4.0))) for misfit in (0.45, 0.65)
    )
    assert little.name == much.name == 'porosity'
    assert much.confidence < 0.8 < little.confidence


def test_a_viscosity_may_leave_more_than_other_effects():
    assert verdict_on(findings(13.0, ('viscosity', 1.0), ('leak', 4.0))).name == 'viscosity'
    assert verdict_on(findings(13.0, ('decay', 1.0), ('leak', 4.0))).name == 'unexplained'
    assert verdict_on(findings(13.0, ('viscosity', 1.4), ('leak', 4.0))).name == 'unexplained'


def with_third(misfit, **third):
    """Return findings where a pair leaves a gap, and a triple leaves `misfit`."""
    parts = (('leak', 0.05), ('rate', 0.08), ('decay', 0.1))
    pairs = [(('rate', 'leak'), 2.0)]
    found = findings(9.0, ('leak', 4.0), pairs=pairs, parts=parts)
    triple = fit('rate', 'leak', 'decay', misfit=misfit, **third)
    return replace(found, triples=[triple], part_changes=[4.0, 2.0, 1.0])


def test_a_third_effect_is_named_where_it_closes_the_gap():
    verdict = verdict_on(with_third(0.45))
    assert verdict.members == ('leak', 'rate', 'decay')
    assert verdict.confidence > 0.8


def test_a_triple_that_leaves_a_gap_names_nothing():
    assert verdict_on(with_third(1.2)).name == 'unexplained'
    assert verdict_on(with_third(0.45, held_out=2.1)).name == 'unexplained'


def test_of_two_wrong_pumps_neither_has_to_be_the_stronger_one():
    pair = (('rate', 'rate'), 0.45)
    found = findings(9.0, ('leak', 4.0), pairs=[pair], parts=(('rate', 0.05), ('rate', 0.05)))
    verdict = verdict_on(found)
    assert verdict.members == ('rate', 'rate')
    assert verdict.confidence > 0.8


def test_a_close_rival_is_the_least_certain_point_of_a_single_effect():
    verdict = verdict_on(findings(3.0, ('leak', 0.30), ('porosity', 0.36)))
    assert verdict.doubt is Doubt.RIVAL and verdict.rival == ('porosity',)


def test_an_effect_that_leaves_nearly_too_much_is_doubted_for_its_remainder():
    verdict = verdict_on(findings(30.0, ('leak', 0.5), ('porosity', 9.0)))
    assert verdict.name == 'leak' and verdict.doubt is Doubt.REMAINDER


def test_a_scant_recording_is_a_doubt_of_its_own():
    verdict = verdict_on(findings(3.0, ('leak', 0.1), ('porosity', 2.0)), frames=2)
    assert verdict.doubt is Doubt.SCANT


def test_a_gap_that_one_effect_alone_can_explain_is_not_doubted_by_an_improbable_rival():
    verdict = verdict_on(findings(90.0, ('leak', 0.1), ('porosity', 80.0)))
    assert (verdict.name, verdict.confidence) == ('leak', 0.99)
    assert verdict.doubt is Doubt.REMAINDER
