"""Log-odds of the statements in a verdict, and its confidence.

A confidence is `1 / (1 + exp(-log_odds))`, within `CONFIDENCE_RANGE`. The rules below give the
log-odds. Their limits were fitted to blinded cases, one kind of statement at a time:
`lab.blind.decided_again` shows how stated confidences and right verdicts differ.
"""

import math
from collections.abc import Collection

import numpy as np

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import larger_misfit, log_odds_against
from porotwin_diagnosis.thresholds import (
    AT_THE_LIMIT,
    CONFIDENCE_RANGE,
    GAP_SLOPE,
    NO_GAP_MISFIT,
    SUFFICIENT_SLOPE,
    SURELY_BESIDE_SHARED,
    SURELY_SUFFICIENT,
)

StrengthMeasures = tuple[float, float]
"""Two measures of how strong a member of a combination is: 1 / (held-out error that it leaves
alone), and the relative L2 norm of the change that it makes alone in the held-out maps."""


def confidence(log_odds: float) -> float:
    """Return the probability 1 / (1 + exp(-log_odds)), clipped to `CONFIDENCE_RANGE`."""
    probability = 1.0 / (1.0 + math.exp(-log_odds))
    return float(np.clip(probability, *CONFIDENCE_RANGE))


def no_gap_log_odds(misfit: float) -> float:
    """Return the log-odds that there is no gap.

    `misfit` is the normalised misfit of the model without effects.
    """
    return GAP_SLOPE * (1.0 - misfit / NO_GAP_MISFIT) + AT_THE_LIMIT


def calibration_log_odds(swallowed: float, gained: float) -> float:
    """Return the log-odds that the verdict explains what the calibration could explain.

    Errors that all maps share take the misfit `swallowed` [-] away from the model; its effects take
    away `gained` [-]. The largest of three values counts:

    - The swallowed misfit is no gap by itself.
    - The effects explain clearly more than the calibration.
    - Even odds: nothing in the recording tells whether the calibration or another effect makes it.
    """
    if swallowed <= 0.0:
        return math.inf
    ratio = max(gained, SMALLEST_DIVISOR) / swallowed
    return max(no_gap_log_odds(swallowed), GAP_SLOPE * math.log(ratio), 0.0)


def sufficient_log_odds(lack_of_fit: float, *, shared_errors: bool = False) -> float:
    """Return the log-odds that a model with this `lack_of_fit` misses nothing.

    An effect outside the library can be imitated, but seldom as well as a true effect fits. With
    `shared_errors` of all maps true effects fit better, so that a lack of fit says more.
    """
    least, surely = (
        (0.0, SURELY_BESIDE_SHARED) if shared_errors else (AT_THE_LIMIT, SURELY_SUFFICIENT)
    )
    return least + SUFFICIENT_SLOPE * max(0.0, surely - lack_of_fit)


def missing_log_odds(lack_of_fit: float) -> float:
    """Return the log-odds that a model with this `lack_of_fit` misses something."""
    return GAP_SLOPE * math.log(lack_of_fit)


def strengths(findings: Findings) -> list[tuple[Fit, StrengthMeasures]]:
    """Return the members of the best combination, each as a fit of its own, with its strengths."""
    return [
        (part, (1.0 / max(part.held_out_error, 1e-9), max(change, 1e-9)))
        for part, change in zip(findings.parts, findings.part_changes, strict=True)
    ]


def share_of(names: Collection[str], probabilities: dict[str, float]) -> float:
    """Return the sum of the `probabilities` of the effects `names`."""
    return sum(probabilities.get(name, 0.0) for name in names)


def single_log_odds(names: Collection[str], probabilities: dict[str, float]) -> float:
    """Return the log-odds of the effects `names`, which look the same, against all others.

    log(p / (1 - p)) with the sum p of their `probabilities`, clipped to `CONFIDENCE_RANGE`.
    """
    low, high = CONFIDENCE_RANGE
    known = min(max(share_of(names, probabilities), low), high)
    return math.log(known / (1 - known))


def pair_log_odds(pair: Fit, rival: Fit | None) -> float:
    """Return the log-odds of `pair` against the best explanation without its first effect.

    They are infinite if there is no such `rival`.
    """
    best = larger_misfit(pair)
    return log_odds_against(larger_misfit(rival) if rival else math.inf, best)


def rival_of_pair(names: Collection[str], findings: Findings) -> Fit | None:
    """Return the judged fit with the least misfit that has none of the effects `names`.

    `names` are the first effect of a pair and those that look the same in its place.
    """
    others = [
        fit
        for fit in (*findings.triples, *findings.pairs, *findings.singles)
        if not any(member.effect in names for member in fit.members)
    ]
    return min(others, key=larger_misfit, default=None)


def rival_of_single(names: Collection[str], probabilities: dict[str, float]) -> str | None:
    """Return the most probable effect, or `NONE`, beside the effects `names`."""
    others = [name for name in probabilities if name not in names]
    return max(others, key=lambda name: probabilities[name], default=None)
