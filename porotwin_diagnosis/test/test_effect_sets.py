"""Sets of effects are ranked by the evidence of their linear responses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import candidate, recorded, sample_of
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.search import effect_sets as module
from porotwin_diagnosis.search.effect_sets import (
    Block,
    SetComparison,
    each_left_out,
    linear_sets,
    may_act,
)
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT
from porotwin_solver.effects.definition.candidate import FitParameter

RATE, POROSITY, CLOCK = 'rate injector', 'porosity', 'clock'


@pytest.fixture(scope='module')
def levels(denser_sand):
    return make_levels([sample_of(denser_sand)], progress=lambda _stage, _share: None)


def space_of(levels, names, local=()):
    return SearchSpace(tuple(candidate(levels.samples, name) for name in names), local)


def labels(found):
    return [{member.label for member in one.added} for one in found]


def none(levels):
    return levels.screening.evaluate((), np.zeros(0))


def test_the_evidence_is_that_of_the_normal_distribution(levels):
    """Its constant is the same for all sets of a comparison."""
    generator = np.random.default_rng(3)
    columns, residual = generator.normal(size=(3, 6)), generator.normal(size=6)
    comparison = SetComparison(
        columns @ columns.T, columns @ residual, float(residual @ residual), 6, 1.0
    )
    members = [candidate(levels.samples, name) for name in (POROSITY, CLOCK, 'decay')]
    blocks = [Block(member, (n,)) for n, member in enumerate(members)]
    groups = [(block,) for block in blocks]
    found = module._largest(comparison, np.array([[0], [1], [2]]), groups)
    variances = np.geomspace(SYSTEMATIC_MISFIT**2, residual @ residual / 6, module.TRIED)
    for value, (block,), _ in found:
        (n,) = block.columns
        outer = np.outer(columns[n], columns[n])
        exact = [multivariate_normal(cov=v * np.eye(6) + outer).logpdf(residual) for v in variances]
        assert value - 3.0 * math.log(2.0 * math.pi) == pytest.approx(logsumexp(exact))
    assert [value for value, *_ in found] == sorted((value for value, *_ in found), reverse=True)


@pytest.mark.parametrize('cells', [0, 6])
def test_where_nothing_is_left_no_set_is_looked_for(levels, cells):
    member = candidate(levels.samples, POROSITY)
    comparison = SetComparison.of(np.zeros(cells), np.zeros((0, cells)), np.ones((1, cells)), 1.0)
    sets = module.LinearSets(none(levels), (Block(member, (0,)),), (comparison,))
    assert sets.best(1, 5) == []


def test_a_prior_does_not_depend_on_the_unit_of_a_parameter():
    in_metres = FitParameter('radius', 'm', 0.0, 0.01, -0.03, 0.03)
    in_millimetres = FitParameter('radius', 'mm', 0.0, 10.0, -30.0, 30.0)
    assert in_metres.prior_deviation == pytest.approx(in_millimetres.prior_deviation)


def test_the_pair_with_the_true_effect_comes_first(levels):
    """The sand of the recording is denser than described."""
    space = space_of(levels, [POROSITY, CLOCK, 'decay'])
    (sets,) = linear_sets(levels, space, none(levels))
    first, *_ = sets.best(2, 5)
    added = {member.label: member for member in first.added}
    assert added[POROSITY].described(added[POROSITY].first).parameters['factor'] < 1.0
    assert len(sets.best(2, 1)) <= len(module.WIDTHS)


def test_an_effect_of_the_fit_is_exchanged_for_the_true_one(levels):
    wrong = candidate(levels.samples, CLOCK)
    fit = levels.screening.fit((wrong,), coarse_steps=1, fine_steps=0)
    beside, instead = linear_sets(levels, space_of(levels, [POROSITY, CLOCK, 'decay']), fit)
    assert (beside.kept.label, instead.kept.label) == (CLOCK, 'none')
    assert labels(beside.best(1, 1))[0] == {POROSITY}
    assert labels(instead.best(1, 1))[0] == {POROSITY}


def test_each_effect_of_a_pair_is_left_out_in_turn(levels):
    members = [candidate(levels.samples, name) for name in ('porosity', 'clock')]
    pair = levels.screening.evaluate(members, np.array([0.5, 0.25]))
    found = [(fit.label, *fit.scaled_parameters, *n) for fit, n in each_left_out(levels, pair)]
    assert found == [('clock', 0.25, 1), ('porosity', 0.5, 0)]


def test_a_leak_joins_at_one_of_its_places(levels):
    (sets,) = linear_sets(levels, space_of(levels, [POROSITY], ('leak',)), none(levels))
    assert len(sets.blocks) > 50
    assert {POROSITY, 'leak'} in labels(sets.best(2, 3))


def test_a_leak_is_found_beside_a_fit_whose_parameters_may_adapt(tmp_path):
    """A shifted picture hides the place of the leak; a fit without the leak imitates both."""
    leak = EffectDescription(name='leak', parameters={'x': 0.2, 'z': 0.29, 'rate': -40.0})
    shift = EffectDescription(name='registration', parameters={'dx': 0.006, 'dz': -0.004})
    sample = sample_of(recorded(tmp_path / 'recording', leak, shift))
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    imitation = levels.screening.fit((candidate([sample], 'registration'),))
    beside, _ = linear_sets(levels, space_of(levels, [], ('leak',)), imitation)
    (first,) = beside.best(1, 1)[-1].added
    start = first.described(first.first).parameters
    assert np.hypot(float(start['x']) - 0.2, float(start['z']) - 0.29) < 0.06
    assert -60.0 < float(start['rate']) < -15.0


def test_an_effect_joins_another_one_or_itself_at_another_well(quiet):
    samples = [sample_of(quiet)]
    rate, porosity = candidate(samples, RATE), candidate(samples, POROSITY)
    other = replace(rate, fixed={'well': 'another'})
    assert may_act(porosity, [rate])
    assert may_act(other, [rate, porosity])
    assert not may_act(rate, [porosity, rate])
    assert not may_act(porosity, [porosity])
