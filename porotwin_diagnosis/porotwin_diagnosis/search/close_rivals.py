"""The comparison of single effects that explain a recording nearly equally well.

Every judged fit has a multifidelity correction and a point spread of its own. Both shift its misfit
a little, in a direction that has nothing to do with its effect. Between fits that lie far apart
this does not matter. Close rivals are therefore judged on each other's corrections too, and their
mean misfits count.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.prior import NO_PRIOR, Prior
from porotwin_diagnosis.search.ranking import (
    lack_of_fit,
    larger_misfit,
    log_odds_against,
)
from porotwin_diagnosis.thresholds import INDISTINGUISHABLE, RIVAL_LOG_ODDS


def compared_rivals(
    levels: Levels, singles: Sequence[Fit], null: Fit, prior: Prior = NO_PRIOR
) -> Judgement:
    """Return judged `singles`, with the close rivals of the first one compared on equal terms.

    Rivals that look the same form a group, whose probabilities add up. The most probable group
    comes first, and its most probable fit. The levels are corrected at the first fit.

    Args:
        levels: the levels of the recordings.
        singles: judged fits of single effects, the most plausible first.
        null: the judged model without effects.
        prior: the belief before this recording.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    rivals = _rivals(singles, null, prior)
    if len(rivals) < 2:
        return Judgement(levels, list(singles))
    labels = {fit.label for fit in rivals}
    others = [fit for fit in singles if fit.label not in labels]
    groups = _groups(levels, _on_equal_terms(levels, rivals))
    best = min(larger_misfit(fit) for group in groups for fit in group)
    groups.sort(key=lambda group: -_probability(group, best, prior))
    ordered = [
        *(fit for g in groups for fit in sorted(g, key=lambda f: -_probability([f], best, prior))),
        *others,
    ]
    return Judgement(levels.corrected_at(ordered[0]), ordered)


def _rivals(singles: Sequence[Fit], null: Fit, prior: Prior) -> list[Fit]:
    """Return the first of `singles` and its close rivals, if all of them explain the recording."""
    best, believed = larger_misfit(singles[0]), prior.belief(singles[0])
    return [
        fit
        for fit in singles
        if lack_of_fit(fit, null) <= 1.0
        and log_odds_against(larger_misfit(fit), best)
        + min(math.log(believed / prior.belief(fit)), 0.0)
        < RIVAL_LOG_ODDS
    ]


def _on_equal_terms(levels: Levels, rivals: Sequence[Fit]) -> list[Fit]:
    """Return `rivals` with their mean misfits over the corrections of all of them."""
    corrected = [levels.corrected_at(fit).judging for fit in rivals]

    def mean(fit: Fit) -> Fit:
        judged = [fitter.evaluated_again(fit) for fitter in corrected]
        fitted, held_out = np.mean([other.unshared_misfit for other in judged], axis=0)
        return replace(
            fit,
            fitted_misfit=float(np.mean([other.fitted_misfit for other in judged])),
            held_out_misfit=float(np.mean([other.held_out_misfit for other in judged])),
            unshared_misfit=(float(fitted), float(held_out)),
        )

    return sorted((mean(fit) for fit in rivals), key=larger_misfit)


def _groups(levels: Levels, rivals: Sequence[Fit]) -> list[list[Fit]]:
    """Return `rivals` in groups that look the same as their first one."""
    groups: list[list[Fit]] = []
    for fit in rivals:
        own = (g for g in groups if levels.judging.distance(g[0], fit) < INDISTINGUISHABLE)
        group = next(own, None)
        if group is None:
            groups.append([fit])
        else:
            group.append(fit)
    return groups


def _probability(group: Sequence[Fit], best: float, prior: Prior) -> float:
    """Return the probability of a `group`, not normalised; `best` is the least misfit of all."""
    effects = {fit.members[0].effect: fit for fit in reversed(group)}
    return sum(
        prior.belief(fit) * math.exp(-log_odds_against(larger_misfit(fit), best))
        for fit in effects.values()
    )
