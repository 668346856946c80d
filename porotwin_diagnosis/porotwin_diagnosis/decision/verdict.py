"""From fits to a verdict: what is kept, what cannot be told apart, when to say nothing.

Everything here is a function of misfits, so that its few constants can be calibrated on simulated
gaps without simulating again; see `calibration`.
"""

import json
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import numpy as np

from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import larger_misfit, normalised_misfit, score

NONE, UNEXPLAINED, NUMERICAL = 'none', 'unexplained', 'numerical_diffusion'

LEFT_BEHIND = 3.0
"""Least log-odds against an effect that fell behind before the final judgement."""

REFUTED = 0.6
"""Confidence in `unexplained` where fronts and maps contradict each other."""


@dataclass(frozen=True)
class Thresholds:
    """What decides, as found on simulated gaps (`calibration.json` says which).

    `quiet`: normalised misfit of a model that explains a recording down to its noise. `open`:
    normalised misfit above which the best model leaves too much; `open_pair`: the same for a pair,
    which suffers from the errors of the schemes twice.
    `of_gap`: share of a large gap that even its true effect leaves, for no scheme follows a strong
    effect exactly.
    `pair_worth`: a second effect must bring the misfit below this share to be kept.
    `systematic`: normalised misfit that the true effect leaves, as a standard deviation, because no
    scheme puts fronts exactly where they are. `same`: largest whitened distance of two predictions
    that cannot be told apart. `scale`, `shift`: logistic map of raw log-odds to seen frequency.
    """

    quiet: float = 0.45
    open: float = 0.53
    open_pair: float = 0.6
    of_gap: float = 0.01
    pair_worth: float = 0.8
    systematic: float = 0.16
    same: float = 0.06
    scale: float = 1.0
    shift: float = 0.0


@cache
def thresholds() -> Thresholds:
    """Return the calibrated thresholds that come with the package."""
    source = files('porotwin_diagnosis.decision') / 'calibration.json'
    return Thresholds(**json.loads(source.read_text(encoding='utf-8'))['thresholds'])


@dataclass(frozen=True)
class Verdict:
    """What the recording says.

    `name` is the verdict, `model` the fit that is kept (for `none` the model without effect),
    `members` its effects, the strongest first, `inseparable` other effects that show the same;
    `alternatives`, of a pair, are other pairs that do. `probabilities` belong to the single
    effects, by name.
    """

    name: str
    confidence: float
    model: Fit
    members: tuple[str, ...]
    inseparable: tuple[str, ...]
    probabilities: dict[str, float]
    alternatives: tuple[tuple[str, ...], ...] = ()


def decide(findings: Findings, limits: Thresholds | None = None) -> Verdict:
    """Return the verdict on `findings`."""
    limits = limits or thresholds()
    null, singles = findings.null, findings.singles
    best = singles[0]
    probabilities = _probabilities(findings, limits)
    before = normalised_misfit(null)
    if before < limits.quiet:
        odds = 4.0 * (1.0 - before / limits.quiet) + 1.0
        return Verdict(NONE, _calibrated(odds, limits), null, (), (), probabilities)
    model = best
    if findings.pairs and _lack_of_fit(best, findings, limits) > 1.0:
        pair = findings.pairs[0]
        if (
            score(pair) < limits.pair_worth * score(best)
            and pair.held_out_misfit < best.held_out_misfit
        ):
            model = pair
    lack_of_fit = _lack_of_fit(model, findings, limits)
    if lack_of_fit > 1.0:
        confidence = _calibrated(_odds_of_more(lack_of_fit), limits)
        return Verdict(UNEXPLAINED, confidence, model, (), (), probabilities)
    members = _by_strength(model, findings)
    alternatives: tuple[tuple[str, ...], ...] = ()
    if len(members) == 1:
        inseparable = _same_as_best(findings.singles, findings.distances, limits)
        lead = _lead_of_single((members[0], *inseparable), probabilities)
    else:
        alternatives = _alternatives(findings, limits)
        inseparable = _in_place_of(members, alternatives)
        lead = _lead_of_pair(model, {members[0], *inseparable}, findings, limits)
        # where one effect nearly suffices, the second may mend what the library lacks
        lead = min(lead, _odds_of_more(_lack_of_fit(best, findings, limits)))
        lead = min(lead, _odds_of_order(members, findings))
    confidence = _calibrated(min(lead, _odds_of_enough(lack_of_fit)), limits)
    return Verdict(members[0], confidence, model, members, inseparable, probabilities, alternatives)


def refuted(verdict: Verdict) -> Verdict:
    """Return `verdict` on a recording whose held-out maps the named effects predict no better than
    the model without them: unexplained, whatever the fronts say."""
    return replace(
        verdict,
        name=UNEXPLAINED,
        confidence=REFUTED,
        members=(),
        inseparable=(),
        alternatives=(),
    )


def _lack_of_fit(model: Fit, findings: Findings, limits: Thresholds) -> float:
    """Return what `model` leaves, relative to what the true effect may leave."""
    limit = limits.open_pair if len(model.members) > 1 else limits.open
    return normalised_misfit(model) / math.hypot(
        limit, limits.of_gap * normalised_misfit(findings.null)
    )


def _odds_of_enough(lack_of_fit: float) -> float:
    """Return the log-odds that there is no more than the model with this `lack_of_fit`, below 1.

    On sealed cases one in nine was wrong above 0.7, all the same to 1, one in sixteen above 0.5
    and one in 150 below: an effect that the library lacks is imitated, but seldom so well.
    """
    return 1.35 + 8.0 * max(0.0, 0.7 - lack_of_fit)


def _odds_of_more(lack_of_fit: float) -> float:
    """Return the log-odds that there is more than the model with this `lack_of_fit`, above 1."""
    return 4.0 * math.log(lack_of_fit)


def _odds_of_order(members: Sequence[str], findings: Findings) -> float:
    """Return the log-odds that the first of two `members` is the stronger one.

    Little is certain where the two are alike, or where what they leave and what they change
    disagree.
    """
    alone = {fit.members[0].effect: strength for fit, strength in _strengths(findings)}
    if set(alone) != set(members):
        return math.inf
    first, second = (alone[name] for name in members)
    ratio = min(first[0] / second[0], first[1] / second[1])
    return 0.4 + 8.0 * max(0.0, math.log(ratio))


def _strengths(findings: Findings) -> list[tuple[Fit, tuple[float, float]]]:
    """Return the members of the best pair with one over the error that each leaves alone of the
    held-out maps, and how much it alone changes them."""
    return [
        (part, (1.0 / max(part.held_out_error, 1e-9), max(change, 1e-9)))
        for part, change in zip(findings.parts, findings.part_changes, strict=True)
    ]


def _lead_of_single(names: tuple[str, ...], probabilities: dict[str, float]) -> float:
    """Return the log-odds of the effects `names`, which show the same, against all others."""
    known = sum(probabilities.get(name, 0.0) for name in names)
    known = min(max(known, 1e-3), 1 - 1e-3)
    return math.log(known / (1 - known))


def _lead_of_pair(
    model: Fit, names: Collection[str], findings: Findings, limits: Thresholds
) -> float:
    """Return the log-odds of the pair `model` with one of `names`, which show the same, against
    the best explanation without any of them."""
    rivals = [
        larger_misfit(fit)
        for fit in (*findings.pairs, *findings.singles)
        if not any(member.effect in names for member in fit.members)
    ]
    return _behind(min(rivals, default=math.inf), larger_misfit(model), limits)


def _calibrated(odds: float, limits: Thresholds) -> float:
    value = 1.0 / (1.0 + math.exp(-(limits.scale * odds + limits.shift)))
    return float(np.clip(value, 0.05, 0.99))


def _behind(misfit: float, best: float, limits: Thresholds) -> float:
    """Return the log-odds of a model that leaves `best` against one that leaves `misfit`.

    Both hold the same noise; what is beyond it in the true one is normal with `systematic`.
    """
    return max(misfit**2 - best**2, 0.0) / (2.0 * limits.systematic**2)


def _probabilities(findings: Findings, limits: Thresholds) -> dict[str, float]:
    """Return the probability of every effect alone, and of none, the most probable first.

    Among judged effects by what they leave; those that show the camera the same as the best one
    share its odds. The others, which stayed behind before, by the misfit with which they did,
    but at least by `LEFT_BEHIND`.
    """
    odds: dict[str, float] = {}
    best = larger_misfit(findings.singles[0])
    for fit, distance in zip(findings.singles, findings.distances, strict=True):
        behind = 0.0 if distance < limits.same else _behind(larger_misfit(fit), best, limits)
        odds.setdefault(fit.members[0].effect, -behind)
    screened = {fit.label: larger_misfit(fit) for fit in reversed(findings.screened)}
    ahead = screened.get(findings.singles[0].label, 0.0)
    for fit in findings.screened:
        behind = max(_behind(larger_misfit(fit), ahead, limits), LEFT_BEHIND)
        odds.setdefault(fit.members[0].effect, -behind)
    odds[NONE] = -_behind(larger_misfit(findings.null), best, limits)
    weights = {name: math.exp(max(value, -60.0)) for name, value in odds.items()}
    total = sum(weights.values())
    shares = {name: weight / total for name, weight in weights.items()}
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _by_strength(model: Fit, findings: Findings) -> tuple[str, ...]:
    """Return the names of the members of `model`, the strongest first.

    That is which closes most when added alone (diagnosis contract). But what spreads fronts also
    closes what the camera's softness opens; how much each changes the maps counts as much.
    """
    strength = {part.label: math.prod(both) for part, both in _strengths(findings)}
    members = sorted(model.members, key=lambda member: -strength.get(member.label, 0.0))
    return tuple(member.effect for member in members)


def _same_as_best(
    fits: Sequence[Fit], distances: Sequence[float], limits: Thresholds
) -> tuple[str, ...]:
    """Return the other effects among the single `fits` that show the camera the same as the best,
    which comes first; `distances` are those from it."""
    best = fits[0].members[0].effect
    alike = (
        fit.members[0].effect
        for fit, distance in zip(fits, distances, strict=True)
        if distance < limits.same
    )
    return tuple(name for name in dict.fromkeys(alike) if name != best)


def _alternatives(findings: Findings, limits: Thresholds) -> tuple[tuple[str, ...], ...]:
    """Return the judged pairs whose best fits show the camera the same as the best pair, each but
    once, whichever of its wells it is about."""
    alike: dict[frozenset[str], tuple[str, ...]] = {}
    for fit, distance in zip(findings.pairs, findings.pair_distances, strict=True):
        names = tuple(member.effect for member in fit.members)
        if distance < limits.same:
            alike.setdefault(frozenset(names), names)
    _best, *others = alike.values()
    return tuple(others)


def _in_place_of(
    members: tuple[str, ...], alternatives: Sequence[tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the effects that stand in the place of the first of `members` in a pair that shows
    the camera the same, the second being kept."""
    first, *others = members
    replaced = (
        name
        for pair in alternatives
        if set(others) < set(pair) and first not in pair
        for name in set(pair) - set(others)
    )
    return tuple(dict.fromkeys(replaced))
