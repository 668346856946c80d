"""The noise that imaging states is bounded by what the best fit leaves."""

from dataclasses import replace

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.noise_bound import (
    noise_share,
    with_bounded_findings,
    with_bounded_levels,
    with_measured_noise,
)
from porotwin_diagnosis.search.ranking import normalised_misfit

STATED, MEASURED = (0.6, 0.6), (0.1, 0.1)


def judged(*effects, misfit, **others):
    fit = fit_of(*effects, misfit=misfit, noise=STATED, **others)
    return replace(fit, stated_noise=STATED, measured_noise=MEASURED)


NULL, BEST = judged(misfit=0.7), judged('clock', misfit=0.3, held_out=0.36)


def test_the_share_is_what_the_best_fit_leaves_in_its_better_part():
    assert noise_share([NULL, BEST]) == pytest.approx(0.5)
    assert noise_share([NULL]) == 1.0


def test_a_gap_under_stated_noise_comes_to_light():
    share = noise_share([NULL, BEST])
    levels = with_bounded_levels(
        make_levels([], progress=lambda _stage, _share: None), [NULL, BEST]
    )
    assert levels.judging.noise_share == share
    bounded = with_bounded_findings(levels, Findings(NULL, NULL, [], [BEST]))
    assert bounded.null.noise_misfit == (0.3, 0.3)
    assert normalised_misfit(NULL) < 0.45 < normalised_misfit(bounded.null)
    assert normalised_misfit(bounded.singles[0]) < 0.2


def test_measured_noise_is_never_reduced():
    assert with_measured_noise(NULL).noise_misfit == MEASURED
    perfect = judged('clock', misfit=0.01)
    levels = make_levels([], progress=lambda _stage, _share: None)
    levels = with_bounded_levels(levels, [NULL, perfect])
    assert with_bounded_findings(levels, Findings(NULL, NULL, [])).null.noise_misfit == MEASURED


def test_without_stated_noise_nothing_changes():
    assert with_measured_noise(fit_of('clock', misfit=0.2, noise=STATED)).noise_misfit == STATED
