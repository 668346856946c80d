"""The verdict, made in one place: rules on the evidence, in their order."""

from porotwin_diagnosis.decision.confidence import (
    calibration_log_odds,
    confidence,
    missing_log_odds,
    no_gap_log_odds,
    order_log_odds,
    pair_log_odds,
    single_log_odds,
    sufficient_log_odds,
)
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.probabilities import effect_probabilities
from porotwin_diagnosis.decision.verdict import NONE, NUMERICAL, UNEXPLAINED, Verdict
from porotwin_diagnosis.search.ranking import (
    far_less,
    gained_misfit,
    lack_of_fit,
    normalised_misfit,
    swallowed_misfit,
)
from porotwin_diagnosis.thresholds import CONTRADICTED_CONFIDENCE, SCANT_CONFIDENCE

Names = tuple[str, ...]


def decide(evidence: Evidence) -> Verdict:
    """Return the verdict on `evidence`. The first rule that applies names it:

    1. The best model misses something: `unexplained`.
    2. The model without effects leaves no gap, and numerical diffusion makes none: `none`.
    3. The held-out maps contradict the best model: `unexplained`.
    4. Otherwise the effects of the best model are named, and numerical diffusion with them.

    On scant evidence no verdict has more than `SCANT_CONFIDENCE`.
    """
    explanation = evidence.explanation
    members, inseparable, alternatives = _named(evidence)
    if not explanation.suffices:
        name, sure = UNEXPLAINED, confidence(missing_log_odds(explanation.lack_of_fit))
    elif not members:
        name, sure = NONE, confidence(_log_odds(evidence))
    elif evidence.contradicted:
        name, sure = UNEXPLAINED, CONTRADICTED_CONFIDENCE
    else:
        name, sure = members[0], confidence(_log_odds(evidence))
    if name == UNEXPLAINED:
        members, inseparable, alternatives = (), (), ()
    return Verdict(
        name,
        min(sure, SCANT_CONFIDENCE) if evidence.scant else sure,
        explanation.model,
        members,
        inseparable,
        effect_probabilities(evidence.findings),
        alternatives,
        close=explanation.close if name in explanation.members else (),
    )


def _named(evidence: Evidence) -> tuple[Names, Names, tuple[Names, ...]]:
    """Return the members, the inseparable effects and the alternatives that would be named.

    Numerical diffusion joins the effects: first if the accurate scheme alone closes more of the gap
    than they do, otherwise last. If it comes first, effects that look the same as the explanation's
    first member become alternatives of the whole.
    """
    kept, numerics = evidence.explanation, evidence.numerics
    members, inseparable, alternatives = kept.members, kept.inseparable, kept.alternatives
    if not numerics.smears:
        return members, inseparable, alternatives
    if not members or not numerics.leads:
        return (*members, NUMERICAL), inseparable, alternatives
    same = alternatives or tuple((name, *members[1:]) for name in inseparable)
    return (NUMERICAL, *members), (), tuple((NUMERICAL, *names) for names in same)


def _log_odds(evidence: Evidence) -> float:
    """Return the log-odds of an explanation that suffices: the smallest of its statements.

    - Any: that it explains more than the errors that all maps share, or that these are no gap.
    - No effect: that there is no gap.
    - One effect: that it is the right one, and that it is enough.
    - A pair or a triple: that it is the right one, that fewer effects are not enough (a further one
      may stand for something that the library lacks), which one is the strongest, and that it is
      enough.
    """
    findings, kept = evidence.findings, evidence.explanation
    null = findings.null
    calibrated = calibration_log_odds(swallowed_misfit(kept.model), gained_misfit(kept.model, null))
    if not kept.members:
        return min(no_gap_log_odds(normalised_misfit(null)), calibrated)
    same = (kept.members[0], *kept.inseparable)
    enough = min(sufficient_log_odds(kept.lack_of_fit), calibrated)
    if len(kept.members) == 1:
        return min(single_log_odds(same, effect_probabilities(findings)), enough)
    fewer = findings.singles[0] if len(kept.model.members) < 3 else findings.pairs[0]
    return min(
        pair_log_odds(kept.model, same, findings),
        missing_log_odds(max(lack_of_fit(fewer, null), far_less(kept.model, fewer))),
        order_log_odds(kept.members, findings),
        enough,
    )
