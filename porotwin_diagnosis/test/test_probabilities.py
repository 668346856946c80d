"""The stated probabilities of effects agree with the confidence of the verdict."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.probabilities import effect_probabilities, stated_probabilities
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.prior import Prior

MODEL = Fit((), np.zeros(0), 1.0, 1.0, 0.1, 0.1, np.zeros((0, 0)))
RAW = {'porosity': 0.45, 'rate': 0.45, 'depth': 0.08, 'leak': 0.02, 'none': 0.0}
NAMES = ['porosity', 'rate', 'depth', 'leak', 'clock']


def shares(name, confidence, *, members=(), inseparable=()):
    verdict = Verdict(name, confidence, MODEL, members, inseparable, RAW)
    return stated_probabilities(verdict, NAMES)


@pytest.mark.parametrize('name', ['none', 'unexplained'])
def test_without_a_named_effect_all_effects_share_the_rest_of_the_confidence(name):
    found = shares(name, 0.95)
    assert sum(found.values()) <= 0.05 + 1e-9
    assert max(found, key=found.get) in ('porosity', 'rate')


def test_the_verdict_has_its_confidence():
    found = shares('porosity', 0.9, members=('porosity',))
    assert found['porosity'] == pytest.approx(0.9)
    assert sum(found.values()) <= 1.0 + 1e-9
    assert found['clock'] == 0.0


def test_effects_that_look_the_same_share_the_confidence():
    found = shares('porosity', 0.9, members=('porosity',), inseparable=('rate',))
    assert found['porosity'] == found['rate'] == pytest.approx(0.45)
    assert found['depth'] > found['leak'] > 0.0


def test_the_second_member_has_the_confidence_of_the_pair():
    found = shares('porosity', 0.8, members=('porosity', 'clock'))
    assert found['clock'] == pytest.approx(0.8)
    assert found['rate'] < 0.2


def test_effects_that_look_the_same_beside_another_share_the_confidence_equally():
    found = shares('porosity', 0.8, members=('porosity', 'leak'), inseparable=('clock',))
    assert found['porosity'] == found['clock'] == pytest.approx(0.4)
    assert found['leak'] == pytest.approx(0.8)


def test_what_looks_the_same_in_the_second_place_shares_its_confidence():
    verdict = Verdict(
        'porosity', 0.8, MODEL, ('porosity', 'leak'), (), RAW, (('porosity', 'clock'),)
    )
    found = stated_probabilities(verdict, NAMES)
    assert found['leak'] == found['clock'] == pytest.approx(0.4)
    assert found['rate'] > 0.0


def test_an_earlier_finding_changes_the_odds_of_effects_that_look_alike():
    singles = [fit_of('porosity', misfit=0.4), fit_of('retardation', misfit=0.4)]
    findings = Findings(fit_of(misfit=6.0), fit_of(misfit=6.0), [], singles, distances=[0.0, 0.01])
    equal = effect_probabilities(findings)
    assert equal['porosity'] == pytest.approx(equal['retardation'])
    told = effect_probabilities(replace(findings, prior=Prior({'retardation': 0.9})))
    assert next(iter(told)) == 'retardation'
    assert told['retardation'] / told['porosity'] > 50
    assert sum(told.values()) == pytest.approx(1.0)


def test_effects_that_leave_all_of_a_gap_have_no_share_if_coarse_cells_misplaced_the_best():
    screened = [
        fit_of(name, misfit=4.2) for name in ('depth', 'decay', 'clock', 'leak', 'viscosity')
    ]
    findings = Findings(
        fit_of(misfit=9.8),
        fit_of(misfit=4.4),
        screened,
        [fit_of('leak', misfit=0.6)],
        distances=[0],
    )
    assert effect_probabilities(findings)['leak'] > 0.999
    with_place = replace(findings, screened=[*screened, fit_of('heterogeneity', misfit=4.2)])
    assert 0.03 < effect_probabilities(with_place)['heterogeneity'] < 0.06
