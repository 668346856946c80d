"""The remainder of the best fit bounds the noise."""

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.noise_bound import (
    noise_share,
    with_bounded_findings,
    with_bounded_levels,
)
from porotwin_diagnosis.search.ranking import normalised_misfit


def judged(*effects, misfit, **others):
    return fit_of(*effects, misfit=misfit, noise=(0.6, 0.6), **others)


NULL, BEST = judged(misfit=0.7), judged('clock', misfit=0.3, held_out=0.36)


def bounded(*singles, null=NULL):
    levels = make_levels([], progress=lambda _stage, _share: None)
    levels = with_bounded_levels(levels, [null, *singles])
    return with_bounded_findings(levels, Findings(null, null, [], list(singles)))


def test_the_share_is_what_the_best_fit_leaves_in_its_better_part():
    assert noise_share([NULL, BEST]) == pytest.approx(0.55)
    assert noise_share([NULL]) == 1.0


def test_a_gap_under_noise_that_was_estimated_too_large_comes_to_light():
    found = bounded(BEST)
    assert found.null.noise_misfit == pytest.approx((0.33, 0.33))
    assert normalised_misfit(NULL) < 0.45 < normalised_misfit(found.null)
    assert normalised_misfit(found.singles[0]) < 0.2
