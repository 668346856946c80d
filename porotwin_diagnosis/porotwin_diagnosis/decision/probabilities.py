"""Probabilities of single effects, from misfits and from the confidence of the verdict."""

import math
from collections.abc import Sequence

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_diagnosis.decision.verdict import NONE, Verdict
from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import larger_misfit, log_odds_against
from porotwin_diagnosis.thresholds import INDISTINGUISHABLE, RIVAL_LOG_ODDS


def effect_probabilities(findings: Findings) -> dict[str, float]:
    """Return the probability of every effect alone, and of `NONE`, the most probable first.

    p_i = exp(-l_i) / sum_j exp(-l_j), with the log-odds l_i of the best effect against effect i:

    - For a judged effect they follow from its misfit. They are 0 if it looks the same as the best.
    - For an effect that was only screened they follow from its misfit on coarse cells. They are at
      least `RIVAL_LOG_ODDS`. The best effect may fit on fine cells only, where its place was
      found. So the misfit on fine cells is estimated too. The model without effects has a misfit
      there, and the effect leaves the same share of it as on coarse cells.

    The belief before the recording (`Prior.belief`) multiplies each exp(-l_i).
    """
    log_odds: dict[str, float] = {}
    believed: dict[str, float] = {}
    prior = findings.prior
    best = larger_misfit(findings.singles[0])
    for fit, distance in zip(findings.singles, findings.distances, strict=True):
        against = (
            0.0 if distance < INDISTINGUISHABLE else log_odds_against(larger_misfit(fit), best)
        )
        log_odds.setdefault(fit.members[0].effect, -against)
        believed.setdefault(fit.members[0].effect, prior.belief(fit))
    screened = {fit.label: larger_misfit(fit) for fit in reversed(findings.screened)}
    best_screened = screened.get(findings.singles[0].label, 0.0)
    for fit in findings.screened:
        against = max(
            log_odds_against(larger_misfit(fit), best_screened),
            log_odds_against(_misfit_on_fine_cells(fit, findings), best),
            RIVAL_LOG_ODDS,
        )
        log_odds.setdefault(fit.members[0].effect, -against)
        believed.setdefault(fit.members[0].effect, prior.belief(fit))
    believed[NONE] = prior.weight(())
    log_odds[NONE] = -log_odds_against(larger_misfit(findings.null), best)
    weights = {name: believed[name] * math.exp(value) for name, value in log_odds.items()}
    total = sum(weights.values())
    probabilities = {name: weight / total for name, weight in weights.items()}
    return dict(sorted(probabilities.items(), key=lambda item: -item[1]))


def _misfit_on_fine_cells(fit: Fit, findings: Findings) -> float:
    """Return the misfit [-] on fine cells that is expected of a screened `fit`.

    It is 0, which proves nothing, for an effect with a place: fine cells may show another place.
    """
    if any(has_place(member.effect) for member in fit.members):
        return 0.0
    on_coarse = max(larger_misfit(findings.screened_null), SMALLEST_DIVISOR)
    return larger_misfit(findings.null) * larger_misfit(fit) / on_coarse


def stated_probabilities(verdict: Verdict, names: Sequence[str]) -> dict[str, float]:
    """Return the probability of each effect in `names`, consistent with the verdict's confidence.

    - The named effect and those inseparable from it share the confidence: in the ratio of their
      probabilities alone, or equally beside other effects, where those say nothing.
    - The second member of a pair has the confidence of the pair. Those that look the same in its
      place share it.
    - All other effects share the rest, 1 - confidence, but at most their probability alone. This
      also holds if the verdict names no effect. The missing part to 1 stands for causes outside the
      library.
    """
    alone = {name: verdict.probabilities.get(name, 0.0) for name in names}
    same = [name for name in (verdict.name, *verdict.inseparable) if name in alone]
    total = sum(alone[name] for name in same) if len(verdict.members) < 2 else 0.0
    stated = {
        name: verdict.confidence * (alone[name] / total if total > 0 else 1 / len(same))
        for name in same
    }
    for place in range(1, len(verdict.members)):
        rows = (verdict.members, *verdict.alternatives)
        options = {row[place] for row in rows if len(row) > place} & {*alone}
        for name in options - {*stated}:
            stated[name] = verdict.confidence / len(options)
    others = [name for name in names if name not in stated]
    scale = (1.0 - verdict.confidence) / max(sum(alone[name] for name in others), 1e-12)
    return stated | {name: alone[name] * min(scale, 1.0) for name in others}
