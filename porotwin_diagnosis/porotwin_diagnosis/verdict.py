"""From fits to a verdict: what is kept, what cannot be told apart, when to say nothing.

Everything here is a function of misfits, so that its few constants can be calibrated on simulated
gaps without simulating again; see `calibration`.
"""

import json
import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from porotwin_diagnosis.fit import Fit, Margin
from porotwin_diagnosis.search import NEAR, Findings, score

NONE, UNEXPLAINED, NUMERICAL = 'none', 'unexplained', 'numerical_diffusion'


@dataclass(frozen=True)
class Thresholds:
    """What decides, as found on simulated gaps (`calibration.json` says which).

    `quiet`: excess of a model that explains a recording down to its noise. `open`: excess above
    which the best model leaves too much, `open_pair` the same for a pair, which can imitate more.
    `pair_worth`: a second effect must bring the misfit below this share to be kept. `sharpness`:
    fall of log-odds per standard deviation of advantage, `steepness` per power of misfit. `same`:
    largest whitened distance of two predictions that cannot be told apart. `scale`, `shift`:
    logistic map of raw log-odds to seen frequency.
    """

    quiet: float = 0.5
    open: float = 0.5
    open_pair: float = 0.42
    pair_worth: float = 0.8
    sharpness: float = 1.0
    steepness: float = 12.0
    same: float = 0.06
    scale: float = 1.0
    shift: float = 0.0


@cache
def thresholds() -> Thresholds:
    """Return the calibrated thresholds that come with the package."""
    source = files('porotwin_diagnosis') / 'calibration.json'
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
    before = findings.excess(null)
    if before < limits.quiet:
        odds = 4.0 * (1.0 - before / limits.quiet) + 1.0
        return Verdict(NONE, _calibrated(odds, limits), null, (), (), probabilities)
    model = best
    if findings.pairs and findings.excess(best) > limits.open:
        pair = findings.pairs[0]
        if score(pair) < limits.pair_worth * score(best) and pair.held_out < best.held_out:
            model = pair
    openness = findings.excess(model) / (
        limits.open_pair if len(model.members) > 1 else limits.open
    )
    if openness > 1.0:
        confidence = _calibrated(4.0 * math.log(openness) + 1.0, limits)
        return Verdict(UNEXPLAINED, confidence, model, (), (), probabilities)
    members = _by_strength(model, findings)
    inseparable = _inseparable(model, findings, limits, members[0])
    lead = (
        _lead_of_pair(model, members[0], findings, limits)
        if len(model.members) > 1
        else _lead_of_single((members[0], *inseparable), probabilities)
    )
    odds = min(lead, 6.0 - 4.0 * openness)
    return Verdict(
        members[0],
        _calibrated(odds, limits),
        model,
        members,
        inseparable,
        probabilities,
        _alternatives(model, findings, limits),
    )


def _lead_of_single(names: tuple[str, ...], probabilities: dict[str, float]) -> float:
    """Return the log-odds of the effects `names`, which show the same, against all others."""
    known = sum(probabilities.get(name, 0.0) for name in names)
    known = min(max(known, 1e-3), 1 - 1e-3)
    return math.log(known / (1 - known))


def _lead_of_pair(model: Fit, name: str, findings: Findings, limits: Thresholds) -> float:
    """Return the log-odds of a pair with effect `name` against the best explanation without it."""
    rivals = [
        score(fit)
        for fit in (*findings.pairs, *findings.singles)
        if name not in (member.effect for member in fit.members)
    ]
    nearest = min([*rivals, NEAR * score(model)])
    return limits.steepness * math.log(max(nearest / score(model), 1.0))


def _calibrated(odds: float, limits: Thresholds) -> float:
    value = 1.0 / (1.0 + math.exp(-(limits.scale * odds + limits.shift)))
    return float(np.clip(value, 0.05, 0.99))


def _lead(fit: Fit, margin: Margin, best: float, limits: Thresholds) -> float:
    """Return the log-odds by which the best effect leads `fit`; none where they show the same."""
    if margin.distance < limits.same:
        return 0.0
    behind = limits.steepness * math.log(max(score(fit) / best, 1.0))
    return max(behind, limits.sharpness * max(margin.advantage, 0.0))


def _ladder(findings: Findings) -> float:
    """Return by what factor scores fall from screening to judgement, for those that made it."""
    screened = {fit.label: score(fit) for fit in findings.screened}
    ratios = [score(fit) / screened[fit.label] for fit in findings.singles if fit.label in screened]
    return float(np.median(ratios)) if ratios else 1.0


def _probabilities(findings: Findings, limits: Thresholds) -> dict[str, float]:
    """Return the probability of every effect alone, and of none, the most probable first.

    Among judged effects by their advantage over each other; the others, which stayed behind before,
    by the misfit with which they did.
    """
    odds: dict[str, float] = {}
    best = score(findings.singles[0])
    for fit, margin in zip(findings.singles, findings.margins, strict=True):
        odds.setdefault(fit.members[0].effect, -_lead(fit, margin, best, limits))
    ladder = _ladder(findings)
    for fit in findings.screened:
        behind = math.log(max(score(fit) * ladder / best, 1.05))
        odds.setdefault(fit.members[0].effect, -limits.steepness * behind)
    odds[NONE] = -limits.steepness * math.log(max(score(findings.null) / best, 1.0))
    weights = {name: math.exp(max(value, -60.0)) for name, value in odds.items()}
    total = sum(weights.values())
    shares = {name: weight / total for name, weight in weights.items()}
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _by_strength(model: Fit, findings: Findings) -> tuple[str, ...]:
    """Return the names of the members of `model`, that which closes most alone first."""
    alone = {fit.label: score(fit) for fit in findings.parts}
    members = sorted(model.members, key=lambda member: alone.get(member.label, math.inf))
    return tuple(member.effect for member in members)


def _inseparable(model: Fit, findings: Findings, limits: Thresholds, name: str) -> tuple[str, ...]:
    """Return the judged effects whose best fits show the camera the same as that of `name`."""
    if len(model.members) > 1:
        return ()
    return tuple(
        fit.members[0].effect
        for fit, margin in zip(findings.singles, findings.margins, strict=True)
        if fit.members[0].effect != name and margin.distance < limits.same
    )


def _alternatives(
    model: Fit, findings: Findings, limits: Thresholds
) -> tuple[tuple[str, ...], ...]:
    """Return the judged pairs whose best fits show the camera the same as the pair `model`."""
    if len(model.members) < 2:
        return ()
    return tuple(
        tuple(member.effect for member in fit.members)
        for fit, margin in zip(findings.pairs, findings.pair_margins, strict=True)
        if fit is not model and margin.distance < limits.same
    )
