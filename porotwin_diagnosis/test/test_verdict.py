"""Verdicts as a function of misfits, and their confidence."""

import math
from dataclasses import replace
from functools import partial

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Thresholds, Verdict, decide, refuted
from porotwin_diagnosis.report.findings_json import read_findings, write_findings
from porotwin_diagnosis.search.findings import Findings

LIMITS = Thresholds()
NOISE = 0.4
"""Misfit of nothing but noise in these findings."""

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


def test_nothing_is_said_of_a_recording_that_the_model_explains():
    verdict = decide(findings(0.45, ('registration', 0.43), ('rate', 0.44)), LIMITS)
    assert verdict.name == 'none'
    assert verdict.confidence > 0.8
    assert verdict.members == ()


def test_an_effect_that_closes_the_gap_alone_is_named():
    verdict = decide(findings(5.0, ('decay', 0.45), ('illumination', 2.4)), LIMITS)
    assert (verdict.name, verdict.members) == ('decay', ('decay',))
    assert verdict.confidence > 0.8


def test_a_gap_that_nothing_closes_is_unexplained():
    verdict = decide(findings(6.0, ('rate', 4.0), ('clock', 4.1)), LIMITS)
    assert verdict.name == 'unexplained'
    assert verdict.members == ()


def test_of_a_large_gap_its_effect_may_leave_more_than_of_a_small_one():
    large = decide(findings(60.0, ('heterogeneity', 0.8), ('leak', 40.0)), LIMITS)
    assert large.name == 'heterogeneity'
    small = decide(findings(6.0, ('heterogeneity', 0.8), ('leak', 4.0)), LIMITS)
    assert small.name == 'unexplained'


def test_two_effects_that_show_the_camera_the_same_are_declared_inseparable():
    distances = [0.0, 0.01, 0.8]
    found = findings(
        3.0, ('porosity', 0.5), ('retardation', 0.5), ('depth', 0.6), distances=distances
    )
    verdict = decide(found, LIMITS)
    assert verdict.inseparable == ('retardation',)
    assert verdict.confidence > 0.8


def test_rivals_that_explain_as_well_but_differ_lower_the_confidence():
    distances = [0.0, 0.9]
    verdict = decide(findings(3.0, ('leak', 0.5), ('rate', 0.5), distances=distances), LIMITS)
    assert verdict.inseparable == ()
    assert verdict.confidence < 0.7


def test_a_pair_is_kept_only_when_the_second_effect_earns_its_place():
    alone = (('rate', 1.6), ('saturation', 4.0))
    pairs, parts = [(('saturation', 'rate'), 0.5)], (('saturation', 4.0), ('rate', 1.7))
    pair = decide(findings(6.0, *alone, pairs=pairs, parts=parts), LIMITS)
    assert pair.members == ('rate', 'saturation')
    single = decide(findings(6.0, *alone, pairs=[(('saturation', 'rate'), 1.5)]), LIMITS)
    assert single.members in (('rate',), ())


def test_pairs_that_show_the_camera_the_same_are_declared():
    pairs = [(('decay', name), 0.5) for name in ('porosity', 'retardation', 'rate')]
    # the same pairs again, of another well or variant, are no further alternatives
    pairs += [(('retardation', 'decay'), 0.5), (('porosity', 'decay'), 0.5)]
    distances = [0.0, 0.01, 0.4, 0.01, 0.01]
    parts = (('decay', 2.0), ('porosity', 8.0))
    found = findings(9.0, ('decay', 1.7), pairs=pairs, pair_distances=distances, parts=parts)
    verdict = decide(found, LIMITS)
    assert verdict.members == ('decay', 'porosity')
    assert verdict.alternatives == (('decay', 'retardation'),)


def test_a_pair_whose_stronger_effect_has_a_double_is_sure_of_both():
    pairs = [(('retardation', 'decay'), 0.3), (('porosity', 'decay'), 0.3)]
    parts = (('retardation', 0.1), ('decay', 0.3))
    found = findings(9.0, ('leak', 2.0), pairs=pairs, pair_distances=[0.0, 0.01], parts=parts)
    found = replace(found, part_changes=[4.0, 2.0])
    verdict = decide(found, LIMITS)
    assert verdict.name == 'retardation'
    assert verdict.inseparable == ('porosity',)
    assert verdict.confidence > 0.9


def test_of_a_pair_the_effect_comes_first_that_leaves_the_smaller_error():
    pairs, parts = (
        [(('registration', 'dispersion'), 0.5)],
        (('registration', 0.3), ('dispersion', 0.2)),
    )
    found = findings(9.0, ('leak', 3.0), pairs=pairs, parts=parts)
    found.parts[0] = fit('registration', misfit=3.0, error=0.3)
    assert decide(found, LIMITS).name == 'dispersion'


def test_an_effect_that_fails_in_what_it_has_not_seen_explains_nothing():
    found = findings(6.0, ('background_flow', 0.45), ('leak', 3.0))
    found.singles[0] = fit('background_flow', misfit=0.45, held_out=0.9)
    assert decide(found, LIMITS).name == 'unexplained'


def test_smearing_does_not_turn_a_rejected_effect_into_a_finding():
    verdict = decide(findings(6.0, ('rate', 4.0), ('clock', 4.1)), LIMITS)
    amended = Numerics('upwind', 9.0, 6.0, 1e-8, found=True).amended(verdict)
    assert amended.name == 'unexplained'
    assert amended.members == ()


def test_of_smearing_and_an_effect_the_one_that_closes_more_comes_first():
    single = Verdict('porosity', 0.9, fit('porosity', misfit=0.5), ('porosity',), ('depth',), {})
    second = Numerics('upwind', 9.0, 6.0, 1e-8, found=True).amended(single)
    assert (second.name, second.members) == ('porosity', ('porosity', 'numerical_diffusion'))
    first = Numerics('upwind', 9.0, 3.0, 1e-8, found=True, leads=True).amended(single)
    assert (first.name, first.members) == (
        'numerical_diffusion',
        ('numerical_diffusion', 'porosity'),
    )
    assert first.inseparable == ()
    assert first.alternatives == (('numerical_diffusion', 'depth'),)


@pytest.mark.parametrize('misfit', [0.3, 0.6, 2.0, 5.0])
def test_confidence_is_a_probability(misfit):
    verdict = decide(findings(6.0, ('rate', misfit), ('clock', misfit)), LIMITS)
    assert 0.0 < verdict.confidence < 1.0
    assert math.isclose(sum(verdict.probabilities.values()), 1.0)


def test_a_verdict_can_be_decided_again_from_the_file_of_findings(tmp_path):
    alone = (('rate', 1.6), ('saturation', 4.0))
    parts = (('saturation', 4.0), ('rate', 1.7))
    found = findings(6.0, *alone, pairs=[(('saturation', 'rate'), 0.5)], parts=parts)
    write_findings(tmp_path / 'findings.json', found)
    again = read_findings(tmp_path / 'findings.json')
    first, second = decide(found, LIMITS), decide(again, LIMITS)
    assert (second.name, second.members) == (first.name, first.members) == ('rate', second.members)
    assert second.confidence == pytest.approx(first.confidence)
    assert second.probabilities == pytest.approx(first.probabilities)


def test_an_effect_that_makes_the_held_out_maps_worse_is_not_named():
    verdict = refuted(decide(findings(5.0, ('decay', 0.45), ('illumination', 2.4)), LIMITS))
    assert (verdict.name, verdict.members) == ('unexplained', ())
    assert verdict.confidence < 0.8


def test_a_pair_is_less_sure_where_one_of_its_effects_nearly_suffices():
    pair = (('well_position', 'depth'), 0.45)
    near = decide(findings(5.0, ('well_position', 0.9), pairs=[pair]), LIMITS)
    far = decide(findings(5.0, ('well_position', 2.0), pairs=[pair]), LIMITS)
    assert near.members == far.members == ('well_position', 'depth')
    assert near.confidence < 0.85 < far.confidence


def test_an_effect_that_leaves_nearly_too_much_is_named_without_being_sure():
    """It may stand for one that the library lacks."""
    little, much = (
        decide(findings(5.0, ('porosity', misfit), ('leak', 4.0)), LIMITS)
        for misfit in (0.45, 0.65)
    )
    assert little.name == much.name == 'porosity'
    assert much.confidence < 0.8 < little.confidence


def test_a_viscosity_may_leave_more_than_other_effects():
    assert decide(findings(13.0, ('viscosity', 0.85), ('leak', 4.0)), LIMITS).name == 'viscosity'
    assert decide(findings(13.0, ('decay', 0.85), ('leak', 4.0)), LIMITS).name == 'unexplained'
    assert decide(findings(13.0, ('viscosity', 1.2), ('leak', 4.0)), LIMITS).name == 'unexplained'


def test_what_fingers_may_leave_as_many_times_more_as_it_magnifies():
    found = findings(13.0, ('viscosity', 1.8), ('leak', 6.0))
    assert decide(found, LIMITS).name == 'unexplained'
    found.singles[0] = replace(found.singles[0], fingering_amplification=(1.2, 1.2))
    assert decide(found, LIMITS).name == 'unexplained'
    found.singles[0] = replace(found.singles[0], fingering_amplification=(3.0, 3.0))
    assert decide(found, LIMITS).name == 'viscosity'


def test_of_a_pair_that_disagrees_on_which_is_stronger_nobody_is_sure():
    parts = (('dispersion', 0.05), ('registration', 0.08))
    pair = (('dispersion', 'registration'), 0.45)
    found = findings(5.0, ('dispersion', 2.5), pairs=[pair], parts=parts)
    found = replace(found, null=replace(found.null, held_out_error=0.2))
    agreed = decide(replace(found, part_changes=[4.0, 2.0]), LIMITS)
    disputed = decide(replace(found, part_changes=[2.0, 2.4]), LIMITS)
    assert agreed.members == disputed.members == ('dispersion', 'registration')
    assert disputed.confidence < 0.65 < agreed.confidence
