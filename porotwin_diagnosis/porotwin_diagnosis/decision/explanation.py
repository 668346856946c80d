"""The best explanation of a recording: the kept model and the inseparable effects.

An explanation is a hypothesis. `verdict_rules.decide` accepts or rejects it with all evidence.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_diagnosis.decision.confidence import share_of, strengths
from porotwin_diagnosis.decision.probabilities import effect_probabilities
from porotwin_diagnosis.decision.verdict import NONE
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import (
    earns_its_place,
    lack_of_fit,
    larger_misfit,
    leaves_a_gap,
    log_odds_against,
    normalised_misfit,
    simplicity,
)
from porotwin_diagnosis.thresholds import (
    INDISTINGUISHABLE,
    NEAR_EQUAL_LOG_ODDS,
    NO_GAP_MISFIT,
)


@dataclass(frozen=True)
class Explanation:
    """The kept model, before its test on the held-out maps.

    Attributes:
        model: the model without effects, the best single effect, pair or triple.
        lack_of_fit: normalised misfit of the model, relative to the largest that a true model has.
            Above 1 the model misses something, and the next four attributes are empty.
        members: names of its effects, the strongest first.
        inseparable: other effects that look the same as the first member, in its place.
        close: other effects that explain the recording nearly as well as the only member.
        alternatives: other pairs that look the same as the best pair.
    """

    model: Fit
    lack_of_fit: float
    members: tuple[str, ...] = ()
    inseparable: tuple[str, ...] = ()
    alternatives: tuple[tuple[str, ...], ...] = ()
    close: tuple[str, ...] = ()

    @property
    def suffices(self) -> bool:
        """Whether the misfit is within the limit for a true model."""
        return self.lack_of_fit <= 1.0


def explain(findings: Findings) -> Explanation:
    """Return the best explanation among `findings`."""
    model = kept_model(findings)
    lack = lack_of_fit(model, findings.null)
    if not model.members:
        return Explanation(model, min(lack, 1.0))  # it is kept only as enough
    if lack > 1.0:
        return Explanation(model, lack)
    members = _strongest_first(model, findings)
    if len(members) == 1:
        same = _inseparable_singles(findings)
        return Explanation(model, lack, members, same, close=_close_singles(findings, same))
    if len(members) > 2:
        return Explanation(model, lack, members)
    alternatives = _inseparable_pairs(findings)
    return Explanation(
        model, lack, members, _in_place_of_first(members, alternatives), alternatives
    )


def kept_model(findings: Findings) -> Fit:
    """Return the model with the fewest effects that explains the recording.

    1. The model without effects, if it leaves no gap. Also if it leaves no more than a true model
       may, and neither an effect nor a pair earns its place beside it.
    2. The best single effect, if it leaves no gap.
    3. The best pair, if the second effect earns its place, and if it leaves no gap.
    4. The best triple, if its further effects earn their place. The true triple may contain no pair
       that is better than its best member.
    5. Otherwise the pair, or the single effect if the second effect has not earned its place.
    6. Instead of a single effect the model without effects, if the effect suffices, has not earned
       its place and is less probable than none.
    """
    null, kept = findings.null, findings.singles[0]
    if normalised_misfit(null) < NO_GAP_MISFIT or _nothing_helps(findings):
        return null
    for combinations in (findings.pairs, findings.triples):
        if not leaves_a_gap(kept):
            break
        best = combinations[0] if combinations else kept
        if earns_its_place(best, kept):
            kept = best
    return null if _is_less_probable_than_none(kept, findings) else kept


def _is_less_probable_than_none(kept: Fit, findings: Findings) -> bool:
    """Return whether a sufficient single effect explains hardly more than no effect does."""
    null = findings.null
    if len(kept.members) > 1 or lack_of_fit(kept, null) > 1.0 or earns_its_place(kept, null):
        return False
    probabilities = effect_probabilities(findings)
    same = (kept.members[0].effect, *_inseparable_singles(findings))
    return share_of(same, probabilities) < probabilities[NONE]


def _nothing_helps(findings: Findings) -> bool:
    """Return whether `null` leaves no more than a true model may, and no effect is clearly better.

    The best single effect of such a recording takes up errors of the scheme or of the camera.
    """
    null = findings.null
    explanations = (*findings.singles, *findings.pairs, *findings.triples)
    return lack_of_fit(null, null) <= 1.0 and not any(
        earns_its_place(fit, null) for fit in explanations
    )


def _strongest_first(model: Fit, findings: Findings) -> tuple[str, ...]:
    """Return the names of the members of `model`, the strongest first.

    The strongest effect closes most of the gap when it is added alone (diagnosis contract). An
    effect that spreads fronts also closes the error that the camera's blur makes, so that the
    change an effect makes in the maps counts as much: both measures are multiplied.
    """
    strength = {part.label: math.prod(both) for part, both in strengths(findings)}
    members = sorted(model.members, key=lambda member: -strength.get(member.label, 0.0))
    return tuple(member.effect for member in members)


def _inseparable_singles(findings: Findings) -> tuple[str, ...]:
    """Return the other single effects whose best fit looks the same as the best single effect."""
    best = findings.singles[0].members[0].effect
    names = (
        fit.members[0].effect
        for fit, distance in zip(findings.singles, findings.distances, strict=True)
        if distance < INDISTINGUISHABLE
    )
    return tuple(name for name in dict.fromkeys(names) if name != best)


def _close_singles(findings: Findings, same: Sequence[str]) -> tuple[str, ...]:
    """Return the single effects that explain the recording nearly as well as the best one.

    They look different from the best one and from the `same` ones, but not so different that the
    recording decides.
    """
    best, *others = findings.singles
    names = (
        fit.members[0].effect
        for fit in others
        if lack_of_fit(fit, findings.null) <= 1.0
        and log_odds_against(larger_misfit(fit), larger_misfit(best))
        + math.log(simplicity(best) / simplicity(fit))
        < NEAR_EQUAL_LOG_ODDS
    )
    known = {best.members[0].effect, *same}
    return tuple(name for name in dict.fromkeys(names) if name not in known)


def _inseparable_pairs(findings: Findings) -> tuple[tuple[str, ...], ...]:
    """Return the other judged pairs that look the same as the best pair.

    Pairs that differ only in the well or the variant of an effect count once.
    """
    same: dict[frozenset[str], tuple[str, ...]] = {}
    for fit, distance in zip(findings.pairs, findings.pair_distances, strict=True):
        names = tuple(member.effect for member in fit.members)
        if distance < INDISTINGUISHABLE:
            same.setdefault(frozenset(names), names)
    _best, *others = same.values()
    return tuple(others)


def _in_place_of_first(
    members: tuple[str, ...], alternatives: Sequence[tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the effects that replace the first of `members` in pairs that keep the second."""
    first, *others = members
    replacements = (
        name
        for pair in alternatives
        if set(others) < set(pair) and first not in pair
        for name in set(pair) - set(others)
    )
    return tuple(dict.fromkeys(replacements))
