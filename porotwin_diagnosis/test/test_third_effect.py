"""A third effect is looked for only beside a pair that is probably part of the truth."""

from dataclasses import replace

import pytest
from diagnosis_examples import candidate, fit_of, sample_of

from porotwin_diagnosis.search.effect_pairs import relocated
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.joint_scan import may_act
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.search.third_effect import (
    bases_of_triples,
    distinct,
    hopeful,
    judged_triples,
)
from porotwin_diagnosis.thresholds import (
    CORRECTED_MISFIT,
    SUFFICIENT_MISFIT,
    SURELY_SUFFICIENT_PAIR,
)

NOTHING = SearchSpace((), ())


@pytest.mark.parametrize(
    'misfit', [0.9 * SURELY_SUFFICIENT_PAIR * SUFFICIENT_MISFIT, 1.1 * CORRECTED_MISFIT, None]
)
def test_no_third_effect_is_looked_for_beside_a_pair_that_suffices_or_fails(quiet, misfit):
    levels = make_levels([sample_of(quiet)], progress=lambda _stage, _share: None)
    null, single = fit_of(misfit=9.0), fit_of('rate', misfit=5.0)
    pairs = [] if misfit is None else [fit_of('rate', 'leak', misfit=misfit)]
    findings = Findings(null, null, [single], [single], pairs)
    assert judged_triples(levels, NOTHING, findings) == (levels, [])
    assert levels.simulations == 0


def test_a_triple_without_a_leak_or_a_zone_has_no_place_to_look_for(quiet):
    levels = make_levels([sample_of(quiet)], progress=lambda _stage, _share: None)
    triple = fit_of('rate', 'porosity', 'clock', misfit=1.0)
    assert relocated(levels, {frozenset(('rate', 'porosity', 'clock')): triple}, 3) == {}
    assert levels.simulations == 0


def test_no_two_of_the_distinct_triples_share_two_effects():
    names = ('registration', 'leak', 'rate'), ('registration', 'leak', 'clock')
    triples = [fit_of(*members, misfit=2.0 + n) for n, members in enumerate(names)]
    triples.append(fit_of('rate', 'leak', 'clock', misfit=4.0))
    triples.append(fit_of('registration', 'decay', 'depth', misfit=1.0))
    chosen = [fit.label for fit in distinct(triples)]
    assert chosen == ['registration + decay + depth', 'registration + leak + rate']


def test_a_triple_that_is_tied_with_the_best_is_judged_too():
    names = ('rate', 'clock', 'depth'), ('rate', 'clock', 'porosity'), ('rate', 'clock', 'decay')
    triples = [fit_of(*members, misfit=1.0 + 0.02 * n) for n, members in enumerate(names)]
    assert distinct(triples) == triples[:2]
    assert distinct([]) == []


def test_the_best_pair_and_those_without_a_common_effect_get_a_third_one():
    names = ('rate', 'decay'), ('rate', 'clock'), ('rate', 'depth'), ('leak', 'decay')
    pairs = [fit_of(*members, misfit=1.0 + n) for n, members in enumerate(names)]
    assert bases_of_triples(pairs) == [pairs[0], pairs[1], pairs[3]]
    assert bases_of_triples([]) == []


def test_a_leak_does_not_push_out_a_zone_beside_the_same_effects():
    both = [fit_of('rate', 'clock', name, misfit=1.0) for name in ('leak', 'heterogeneity')]
    assert distinct(both) == both


def test_an_effect_joins_another_one_or_itself_at_another_well(quiet):
    samples = [sample_of(quiet)]
    rate, porosity = candidate(samples, 'rate injector'), candidate(samples, 'porosity')
    other = replace(rate, fixed={'well': 'another'})
    assert may_act(porosity, [rate])
    assert may_act(other, [rate, porosity])
    assert not may_act(rate, [porosity, rate])
    assert not may_act(porosity, [porosity])


def test_a_triple_that_leaves_as_much_as_the_pair_is_not_judged():
    pair = fit_of('rate', 'clock', misfit=1.3)
    triples = [fit_of('rate', 'clock', 'decay', misfit=misfit) for misfit in (0.5, 1.28)]
    assert hopeful(triples, pair) == triples[:1]
