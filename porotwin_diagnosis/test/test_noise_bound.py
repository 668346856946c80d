"""The noise is bounded by what the best fit leaves."""

from dataclasses import replace

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.noise_bound import (
    noise_bound,
    with_bounded_findings,
    with_bounded_levels,
    with_measured_noise,
)
from porotwin_diagnosis.search.ranking import normalised_misfit

STATED, MEASURED = (0.6, 0.6), (0.1, 0.1)


def judged(*effects, misfit, measured=MEASURED, **others):
    fit = fit_of(*effects, misfit=misfit, noise=STATED, **others)
    return replace(fit, stated_noise=STATED, measured_noise=measured)


NULL, BEST = judged(misfit=0.7), judged('clock', misfit=0.3, held_out=0.36)


def bounded(*singles, null=NULL):
    levels = make_levels([], progress=lambda _stage, _share: None)
    levels = with_bounded_levels(levels, [null, *singles])
    return with_bounded_findings(levels, Findings(null, null, [], list(singles)))


def test_the_share_is_what_the_best_fit_leaves_in_its_better_part():
    assert noise_bound([NULL, BEST]) == pytest.approx((0.5, 1.0))
    assert noise_bound([NULL]) == (1.0, 1.0)


def test_a_gap_under_stated_noise_comes_to_light():
    found = bounded(BEST)
    assert found.null.noise_misfit == pytest.approx((0.3, 0.3))
    assert normalised_misfit(NULL) < 0.45 < normalised_misfit(found.null)
    assert normalised_misfit(found.singles[0]) < 0.2


def test_measured_noise_counts_as_long_as_no_fit_contradicts_it():
    assert with_measured_noise(NULL).noise_misfit == MEASURED
    assert bounded(judged('clock', misfit=0.1)).null.noise_misfit == MEASURED


def test_structure_that_was_measured_as_noise_hides_no_gap():
    striped = (0.6, 0.6)
    null, best = judged(misfit=0.7, measured=striped), judged('clock', misfit=0.2, measured=striped)
    assert normalised_misfit(null) < 0.45
    assert normalised_misfit(bounded(best, null=null).null) > 0.45


def test_without_stated_noise_nothing_is_only_stated():
    assert with_measured_noise(fit_of('clock', misfit=0.2, noise=STATED)).noise_misfit == STATED
