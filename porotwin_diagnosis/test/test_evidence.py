"""When evidence is scant, and when the held-out maps contradict an explanation."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.evidence import Evidence, place_uncertainty
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.search.findings import Findings
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter


def evidence(errors=(0.2, 0.05), cells_along=94, frames=20):
    null = fit_of(misfit=5.0)
    findings = Findings(null, null, [], [fit_of('decay', misfit=0.4)], distances=[0.0])
    numerics = Numerics('accurate', 5.0, 5.0)
    return Evidence(findings, explain(findings), numerics, errors, cells_along, frames)


def test_an_effect_with_which_the_error_grows_is_contradicted():
    assert evidence((0.10, 0.11)).contradicted
    assert not evidence((0.20, 0.05)).contradicted


def test_an_effect_that_changes_nothing_in_the_held_out_part_is_not_contradicted():
    """A late clock, if the pumps rest at last: its gap arose before."""
    assert not evidence((0.1000, 0.1008)).contradicted


@pytest.mark.parametrize(('cells_along', 'frames'), [(79, 20), (94, 3)])
def test_large_cells_and_few_frames_are_scant(cells_along, frames):
    assert evidence(cells_along=cells_along, frames=frames).scant
    assert not evidence(cells_along=80, frames=4).scant


def leaks(deviation_m):
    """Return a fit of two leaks; the place of the second one has this standard deviation."""
    x = FitParameter('x', 'm', 0.4, 0.01, 0.0, 0.9)
    rate = FitParameter('rate', 'ml/h', 0.0, 8.0)
    leak = Candidate('leak', (x, rate))
    deviations = np.array([0.1, 3.0, deviation_m / x.step, 40.0])
    fit = fit_of('leak', 'leak', misfit=0.4)
    return replace(
        fit,
        members=(leak, leak),
        scaled_parameters=np.zeros(4),
        covariance=np.diag(deviations**2),
    )


def test_a_leak_that_may_lie_almost_anywhere_has_lost_its_place():
    half_width = 1.645 * 1.7 * 0.1 / 0.9
    assert place_uncertainty(leaks(0.1)) == pytest.approx(half_width)
    assert replace(evidence(), place_uncertainty=half_width).has_lost_place
    assert not replace(evidence(), place_uncertainty=place_uncertainty(leaks(0.05))).has_lost_place
    assert place_uncertainty(fit_of('decay', misfit=0.4)) == 0.0


def test_a_weak_gap_leaves_the_place_of_a_true_leak_open_too():
    lost = replace(evidence(), place_uncertainty=1.0)
    weak = replace(lost.findings, null=fit_of(misfit=0.5))
    assert lost.has_lost_place
    assert not replace(lost, findings=weak).has_lost_place
