"""The comparison of fits, and the selection of the fits that go on.

A judged fit has a misfit m (`data.misfit`) and a misfit n from noise alone, each for the fitted and
for the held-out part. The following quantities derive from them:

    score = sqrt((m_fitted^2 + m_held_out^2) / 2)
    larger misfit = max(m_fitted, m_held_out)
    misfit beyond the noise = sqrt(max(m^2 - (NOISE_UNCERTAINTY n)^2, 0))
    normalised misfit = max over the parts of (misfit beyond the noise) / V

V is the misfit allowance of the effects of the fit and of those that rig.yaml describes, 1 for most
effects. The held-out part counts by itself, because a wrong effect adapts to the fitted part and
fails in the held-out one.
"""

import math
from collections.abc import Sequence

import numpy as np

from porotwin_diagnosis.model.effect_traits import misfit_allowance
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.thresholds import (
    CLOSE_TO_BEST,
    COMBINATION_GAIN,
    NO_GAP_MISFIT,
    NOISE_UNCERTAINTY,
    ODDS_PER_PARAMETER,
    SUFFICIENT_MISFIT,
    SYSTEMATIC_MISFIT,
    UNRESOLVED_SHARE,
)
from porotwin_solver.effects.definition.candidate import Candidate


def misfit_beyond_noise(fit: Fit) -> tuple[float, float]:
    """Return the misfit [-] beyond the noise, sqrt(max(m^2 - (1.1 n)^2, 0)): fitted, held out."""
    fitted, held_out = (
        math.sqrt(max(total**2 - (NOISE_UNCERTAINTY * noise) ** 2, 0.0))
        for total, noise in zip(
            (fit.fitted_misfit, fit.held_out_misfit), fit.noise_misfit, strict=True
        )
    )
    return fitted, held_out


def normalised_misfit(fit: Fit) -> float:
    """Return the misfit [-] beyond the noise relative to the one that the true effect may leave.

    It is max(b_fitted, b_held_out) / V, with the misfit b beyond the noise and the misfit allowance
    V.
    """
    effects = (*(member.effect for member in fit.members), *fit.described)
    return max(misfit_beyond_noise(fit)) / misfit_allowance(effects)


def swallowed_misfit(fit: Fit) -> float:
    """Return the misfit [-] that only the errors that all maps share take away from `fit`.

    It is the larger one of sqrt(max(u^2 - m^2, 0)) over the parts, with the misfit m, and the
    misfit u if these errors were zero.
    """
    misfits = (fit.fitted_misfit, fit.held_out_misfit)
    pairs = zip(fit.unshared_misfit, misfits, strict=True)
    return max(math.sqrt(max(without**2 - total**2, 0.0)) for without, total in pairs)


def gained_misfit(fit: Fit, null: Fit) -> float:
    """Return the misfit [-] that the effects of `fit` take away from the model without effects."""
    return math.sqrt(max(larger_misfit(null) ** 2 - larger_misfit(fit) ** 2, 0.0))


def score(fit: Fit) -> float:
    """Return the misfit [-] of both parts together, sqrt((m_fitted^2 + m_held_out^2) / 2)."""
    return overall_misfit(fit.fitted_misfit, fit.held_out_misfit)


def overall_misfit(fitted: float, held_out: float) -> float:
    """Return the root mean square of the misfits [-] of the fitted and the held-out part."""
    return float(np.hypot(fitted, held_out) / np.sqrt(2.0))


def larger_misfit(fit: Fit) -> float:
    """Return the larger of the misfits [-] of the fitted and the held-out part."""
    return max(fit.fitted_misfit, fit.held_out_misfit)


def log_odds_against(misfit: float, best: float) -> float:
    """Return the log-odds of a model with misfit `best` against a model with `misfit`.

    Both misfits contain the same noise. The remainder of the true model is normal with the standard
    deviation s = `SYSTEMATIC_MISFIT`, which gives (misfit^2 - best^2) / (2 s^2), at least 0.
    """
    return max(misfit**2 - best**2, 0.0) / (2.0 * SYSTEMATIC_MISFIT**2)


def lack_of_fit(model: Fit, null: Fit) -> float:
    """Return the misfit of `model` relative to the largest misfit of a true model.

    lack of fit = m / sqrt(limit^2 + (u m0)^2), with the normalised misfits m of the model and m0 of
    the model without effects, `null`. The limit is `SUFFICIENT_MISFIT`, u is `UNRESOLVED_SHARE`.
    """
    left = UNRESOLVED_SHARE * normalised_misfit(null)
    return normalised_misfit(model) / math.hypot(SUFFICIENT_MISFIT, left)


def simplicity(fit: Fit) -> float:
    """Return the factor on the odds of a single effect for its p parameters, 0.5^p."""
    return float(ODDS_PER_PARAMETER ** len(fit.scaled_parameters))


def leaves_a_gap(fit: Fit) -> bool:
    """Return whether the judged `fit` leaves something for a further effect.

    It does above `SUFFICIENT_MISFIT`, however large the gap was.
    """
    return normalised_misfit(fit) > SUFFICIENT_MISFIT


def may_need_a_second_effect(single: Fit, null: Fit) -> bool:
    """Return whether pairs are worth their time beside the best `single` effect.

    They are if both it and the model without effects, `null`, leave a gap.
    """
    return normalised_misfit(null) >= NO_GAP_MISFIT and leaves_a_gap(single)


def earns_its_place(more: Fit, fewer: Fit) -> bool:
    """Return whether the further effects earn their place in the judged fit `more`.

    More effects always fit better. With every further effect the score must fall below
    `COMBINATION_GAIN` of that of the fit with `fewer` effects, and the held-out misfit must fall.
    """
    least = COMBINATION_GAIN ** max(1, len(more.members) - len(fewer.members))
    return score(more) < least * score(fewer) and more.held_out_misfit < fewer.held_out_misfit


def feasible(fits: Sequence[Fit]) -> list[Fit]:
    """Return the feasible `fits`: the model could run with their effects."""
    return [fit for fit in fits if fit.is_feasible]


def close_to_best(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fits whose score is close to the best one, the second in any case.

    `fits` are sorted by their score.
    """
    return [
        fit
        for index, fit in enumerate(fits)
        if index < 2 or score(fit) < CLOSE_TO_BEST * score(fits[0])
    ]


def ranked(fits: Sequence[Fit]) -> list[Fit]:
    """Return the judged `fits`, the most plausible first.

    They are sorted by larger misfit. If the same effects were fitted several times, only the best
    fit is kept.
    """
    best: dict[frozenset[str], Fit] = {}
    for fit in sorted(fits, key=larger_misfit):
        best.setdefault(member_labels(fit.members), fit)
    return list(best.values())


def first_of_each_effect(fits: Sequence[Fit]) -> list[Fit]:
    """Return the first fit of every effect and well among `fits` of single effects."""
    first: dict[tuple[str, object], Fit] = {}
    for fit in fits:
        first.setdefault(effect_and_well(fit), fit)
    return list(first.values())


def effect_and_well(fit: Fit) -> tuple[str, object]:
    """Return the effect of a single-effect `fit` and its well, if any; variants are the same."""
    member = fit.members[0]
    return member.effect, member.fixed.get('well')


def member_labels(members: Sequence[Candidate]) -> frozenset[str]:
    """Return the labels of `members` without their order, as a key of fits of the same effects."""
    return frozenset(member.label for member in members)
