"""The verdict, made in one place: rules on the evidence, in their order."""

from porotwin_diagnosis.decision.confidence import (
    calibration_log_odds,
    confidence,
    missing_log_odds,
    no_gap_log_odds,
    pair_log_odds,
    rival_of_pair,
    rival_of_single,
    share_of,
    single_log_odds,
    sufficient_log_odds,
)
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.probabilities import effect_probabilities
from porotwin_diagnosis.decision.verdict import NONE, NUMERICAL, UNEXPLAINED, Doubt, Verdict
from porotwin_diagnosis.search.ranking import (
    gained_misfit,
    lack_of_fit,
    normalised_misfit,
    swallowed_misfit,
)
from porotwin_diagnosis.thresholds import (
    CONFIDENCE_RANGE,
    OPEN_CONFIDENCE,
)

Names = tuple[str, ...]


def decide(evidence: Evidence) -> Verdict:
    """Return the verdict on `evidence`. The first rule that applies names it:

    1. The best model misses something: `unexplained`.
    2. The model without effects leaves no gap, and numerical diffusion makes none: `none`.
    3. Otherwise the effects of the best model are named, and numerical diffusion with them. A late
       clock has `OPEN_CONFIDENCE` at most if tracer from before the recording makes the same maps.

    On scant evidence, and after a search that was ended, no verdict has more than
    `OPEN_CONFIDENCE`. After such a search `unexplained` has the least confidence: an effect that
    was not tried may explain all.
    """
    explanation = evidence.explanation
    probabilities = effect_probabilities(evidence.findings)
    members, inseparable, alternatives = _named(evidence)
    if not explanation.suffices:
        name, doubt = UNEXPLAINED, Doubt.REMAINDER
        sure = confidence(missing_log_odds(explanation.lack_of_fit))
    else:
        name = members[0] if members else NONE
        log_odds, doubt = min(_statements(evidence, probabilities))
        sure = confidence(log_odds)
    untried = bool(evidence.findings.untried)
    for applies, reason in (
        (name in members and evidence.has_open_clock, Doubt.START),
        (evidence.scant, Doubt.SCANT),
        (untried, Doubt.UNTRIED),
    ):
        if applies and sure > OPEN_CONFIDENCE:
            doubt, sure = reason, OPEN_CONFIDENCE
    if name == UNEXPLAINED:
        sure = CONFIDENCE_RANGE[0] if untried else sure
        members, inseparable, alternatives = (), (), ()
    return Verdict(
        name,
        round(sure, 3),  # as the files state it, so that no two places round it differently
        explanation.model,
        members,
        inseparable,
        probabilities,
        alternatives,
        close=explanation.close if name in explanation.members else (),
        doubt=doubt,
        rival=_rival(evidence, probabilities),
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


def _statements(evidence: Evidence, probabilities: dict[str, float]) -> list[tuple[float, Doubt]]:
    """Return the log-odds of all statements of an explanation that suffices.

    - Any: that it explains more than the errors that all maps share, or that these are no gap.
    - No effect: that there is no gap.
    - One effect: that it is the right one, and that it is enough. The first one is left out if no
      other explanation is left: the library holds nothing to doubt it by.
    - A pair or a triple: that it is the right one, that fewer effects are not enough (a further one
      may stand for something that the library lacks), and that it is enough.
    """
    findings, kept = evidence.findings, evidence.explanation
    null = findings.null
    swallowed, gained = swallowed_misfit(kept.model), gained_misfit(kept.model, null)
    calibrated = (calibration_log_odds(swallowed, gained), Doubt.CALIBRATION)
    if not kept.members:
        return [(no_gap_log_odds(normalised_misfit(null)), Doubt.NO_GAP), calibrated]
    same = (kept.members[0], *kept.inseparable)
    shared_errors = swallowed > 0.0
    misses_nothing = sufficient_log_odds(kept.lack_of_fit, shared_errors=shared_errors)
    enough = [(misses_nothing, Doubt.REMAINDER), calibrated]
    if len(kept.members) == 1:
        if share_of(same, probabilities) >= CONFIDENCE_RANGE[1]:
            return enough
        return [(single_log_odds(same, probabilities), Doubt.RIVAL), *enough]
    right = pair_log_odds(kept.model, rival_of_pair(same, findings))
    fewer = findings.singles[0] if len(kept.model.members) < 3 else findings.pairs[0]
    needed = missing_log_odds(lack_of_fit(fewer, null))
    return [(right, Doubt.RIVAL), (needed, Doubt.FEWER), *enough]


def _rival(evidence: Evidence, probabilities: dict[str, float]) -> Names:
    """Return the effects of the most probable explanation beside the kept one."""
    findings, kept = evidence.findings, evidence.explanation
    if not kept.members:
        return ()
    same = (kept.members[0], *kept.inseparable)
    if len(kept.members) == 1:
        other = rival_of_single(same, probabilities)
        return (other,) if other else ()
    fit = rival_of_pair(same, findings)
    return tuple(member.effect for member in fit.members) if fit else ()
