"""The evidence of sets of effects: known solutions, units, and draws from the priors."""

import numpy as np
import pytest
from scipy.stats import gamma, multivariate_normal

from lab.stored import laplace
from lab.stored.laplace import SetEvidence, judged, log_evidence, posterior, spectrum_of
from lab.stored.linear_sets import SOURCE, WAVES, LinearSet, linear_set, random_fields
from porotwin_core.model.fitted_effect import Candidate, FitParameter
from porotwin_diagnosis.model.fit import infeasible_fit


def model(residual, columns):
    matrix, r = np.array(columns), np.array(residual)
    return LinearSet((), float(r @ r), matrix @ matrix.T, matrix @ r, np.zeros(len(matrix)))


def test_the_evidence_is_that_of_the_normal_distribution_with_all_modes(monkeypatch):
    residual, mode = np.array([1.0, 2.0, -0.5]), np.array([0.5, 1.0, 2.0])
    monkeypatch.setattr(laplace, 'VARIANCES', np.geomspace(0.03, 300.0, 2000))
    v, outer = laplace.VARIANCES, np.outer(mode, mode)
    prior = gamma(laplace.SHAPE, scale=1.0 / ((laplace.SHAPE - 1.0) * 3.0)).pdf(1.0 / v) / v**2
    exact = [multivariate_normal(cov=one * np.eye(3) + outer).pdf(residual) for one in v]
    found = log_evidence(model(residual, [mode]), 1.0, cells=3.0, correlated=1.0, variance=3.0)
    exact = np.log(np.trapezoid(exact * prior, v))
    assert found - 1.5 * np.log(2.0 * np.pi) == pytest.approx(exact, abs=1e-3)


def test_a_set_that_leaves_more_than_noise_loses_to_something_else_and_a_temper_flattens():
    sets = [SetEvidence((), -90.0, -70.0), SetEvidence(('decay',), -1.0, -9.0)]
    found = posterior(sets, 5, 1.0)
    assert found['decay',] > 0.99 > 0.5 > posterior(sets, 5, 0.01)['decay',]
    assert next(iter(posterior(sets, 5, 1.0, unknown=('decay',)))) == ('unexplained',)
    assert judged(('leak',), 1, found).is_sure_and_wrong and judged(('decay',), 1, found).is_whole


def test_random_fields_are_as_large_as_stated_and_longer_ones_have_fewer_waves():
    c = np.full((6, 8, 10), 0.5)
    fields = random_fields(c, np.ones(c.shape), 2)
    waves = int(np.prod(WAVES))
    assert np.mean(fields[:waves] ** 2) == pytest.approx(SOURCE**2) and not fields[waves:].any()
    short, long = spectrum_of(0.0)[:waves], spectrum_of(0.5)[:waves]
    assert short @ short == pytest.approx(long @ long) and long[0] > short[0]


def test_the_evidence_does_not_depend_on_the_unit_of_a_parameter():
    """A place in metres and in millimetres, with its step, and with another step, is one model."""
    found = []
    residual, slope = np.array([1.0, -2.0, 0.5]), np.array([[0.3, 0.1, -0.7]])
    for unit, step in ((1.0, 0.01), (1000.0, 10.0), (1.0, 0.002)):
        place = FitParameter('x', 'm', 0.2 * unit, step, 0.0, 0.5 * unit)
        scaled = np.array([place.scaled(0.23 * unit)])
        fit = infeasible_fit((Candidate('leak', (place,)),), scaled)
        per_step = slope * place.step / (0.01 * unit)
        one = linear_set(('leak',), residual, per_step, np.ones((1, 3)), fit)
        found.append(log_evidence(one, 1.0, cells=3.0, correlated=1.0, variance=1.0))
    assert found[1:] == pytest.approx([found[0]] * 2, abs=1e-9)


EFFECTS, CELLS, DRAWS = 3, 40, 150
NUMBERS = {'cells': float(CELLS), 'correlated': 1.0, 'variance': 1.0}


def drawn_set(generator, responses, fields):
    """Return the names and the maps of a set from the prior: a class, then one of its sets."""
    kind = generator.choice(['none', 'one', 'beside'])
    count = int(generator.integers(2)) if kind == 'beside' else int(kind == 'one')
    chosen = [int(n) for n in generator.permutation(EFFECTS)[:count]]
    names = tuple(f'effect {n}' for n in chosen)
    maps = sum((generator.normal() * responses[n] for n in chosen), np.zeros(CELLS))
    amplitude = generator.choice(laplace.LARGE if kind == 'beside' else laplace.SMALL)
    scale = amplitude * spectrum_of(generator.choice(laplace.LENGTHS))
    maps = maps + (scale * generator.normal(size=len(scale))) @ fields
    return ('unexplained',) if kind == 'beside' else names or ('none',), maps


def test_the_confidence_is_calibrated_on_draws_from_the_priors(monkeypatch):
    monkeypatch.setattr(laplace, 'WAVES', (1, 2, 2))
    monkeypatch.setattr(laplace, 'OUTSIDE', 1.0)
    generator = np.random.default_rng(5)
    responses = 2.0 * generator.normal(size=(EFFECTS, CELLS))
    fields = 2.0 * generator.normal(size=(len(spectrum_of(0.0)), CELLS))
    stated, right = [], []
    for _ in range(DRAWS):
        truth, maps = drawn_set(generator, responses, fields)
        variance = 1.0 / generator.gamma(laplace.SHAPE, 1.0 / (laplace.SHAPE - 1.0))
        residual = maps + np.sqrt(variance) * generator.normal(size=CELLS)
        sets = []
        for names in ((), *((f'effect {n}',) for n in range(EFFECTS))):
            own = [responses[int(name[-1])] for name in names]
            whole = model(residual, [*own, *fields])
            sets.append(laplace.set_evidence(whole._replace(names=names), len(fields), NUMBERS))
        first, share = next(iter(posterior(sets, EFFECTS, 1.0).items()))
        stated.append(share)
        right.append(first == truth)
    spread = np.sqrt(np.sum([p * (1.0 - p) for p in stated]))
    assert abs(np.sum(right) - np.sum(stated)) < 2.5 * spread
    assert np.mean(right) > 0.6
