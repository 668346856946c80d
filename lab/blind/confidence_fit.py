"""A map from stated confidences to observed frequencies, fitted to the scores of blind checks.

    python -m lab.blind.confidence_fit blind/scores.json [MORE.json ...]

The diagnosis states its confidences without such a map. The fit says which one would make them
true: Platt's logistic map (in Advances in Large Margin Classifiers, MIT Press 1999)

    frequency = 1 / (1 + exp(-(scale * log_odds + shift)))

by maximum likelihood, with a weak prior at the identity (scale 1, shift 0), so that a few lucky
cases do not raise the confidences. Cross-validation tells whether the map is better than none: each
tenth of the cases is judged by a map that was fitted to the others.

Even true confidences have an error if the cases are few. `error_by_chance` says how large it is.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from lab.blind.blind_table import expected_error

PRIOR_WEIGHT = 2.0
"""Weight of the prior: a scale or a shift that is off by 1 costs as much as about two cases."""

LEAST_DOUBT = 1e-3
"""Least distance of a confidence from 0 and 1, so that log-odds stay finite."""

SCALE_RANGE, SHIFT_RANGE = (0.1, 5.0), (-5.0, 5.0)
"""Ranges of the map: beyond, it would turn every confidence into 0, 1/2 or 1."""


FEWEST_CASES = 100
"""Cases below which the identity is kept: of 100 cases with 0.9, chance moves the share that is
right by 0.03, as much as a map should gain."""

FOLDS = 10
"""Parts of a cross-validation."""


class ConfidenceMap(NamedTuple):
    """frequency = 1 / (1 + exp(-scale * log_odds - shift)); the identity is (1, 0)."""

    scale: float
    shift: float


def fit_confidence_map(confidences: ArrayLike, right: ArrayLike) -> ConfidenceMap:
    """Return the map that fits the stated `confidences` and whether each verdict was `right`."""
    stated = np.clip(np.asarray(confidences, dtype=float), LEAST_DOUBT, 1 - LEAST_DOUBT)
    log_odds = np.log(stated / (1 - stated))
    observed = np.asarray(right, dtype=float)

    def cost(values: np.ndarray) -> float:
        logits = values[0] * log_odds + values[1]
        likelihood = np.sum(np.logaddexp(0.0, logits) - observed * logits)
        return float(likelihood + PRIOR_WEIGHT * ((values[0] - 1.0) ** 2 + values[1] ** 2))

    found = minimize(cost, np.array([1.0, 0.0]), bounds=[SCALE_RANGE, SHIFT_RANGE])
    return ConfidenceMap(float(found.x[0]), float(found.x[1]))


IDENTITY = ConfidenceMap(1.0, 0.0)
"""The map that leaves confidences as they are."""


def mapped(found: ConfidenceMap, confidences: ArrayLike) -> np.ndarray:
    """Return the frequencies that the map `found` states for `confidences`."""
    stated = np.clip(np.asarray(confidences, dtype=float), LEAST_DOUBT, 1 - LEAST_DOUBT)
    logits = found.scale * np.log(stated / (1 - stated)) + found.shift
    return np.asarray(1 / (1 + np.exp(-logits)))


class JudgedMap(NamedTuple):
    """A fitted map, and how far confidences are from observed frequencies with and without it.

    `error_stated` and `error_mapped` are expected calibration errors of `cases` cases, the second
    one by cross-validation. True confidences would have `error_by_chance`. `kept` is the map to
    use: the identity where the cases are too few, or where the fitted map is no better.
    """

    fitted: ConfidenceMap
    cases: int
    error_stated: float
    error_mapped: float
    error_by_chance: float

    @property
    def kept(self) -> ConfidenceMap:
        better = self.cases >= FEWEST_CASES and self.error_mapped < self.error_stated
        return self.fitted if better else IDENTITY


CHANCE_DRAWS = 500
"""Draws of outcomes for the error by chance, which they determine to about 3 % of its value."""


def error_by_chance(confidences: ArrayLike) -> float:
    """Return the mean calibration error [-] that cases have if their `confidences` are true."""
    stated = np.asarray(confidences, dtype=float)
    generator = np.random.default_rng(0)
    drawn = generator.random((CHANCE_DRAWS, len(stated))) < stated
    return float(np.mean([expected_error(stated, right) for right in drawn]))


def judged_map(confidences: ArrayLike, right: ArrayLike) -> JudgedMap:
    """Return the map that fits the cases, judged by cross-validation."""
    stated, observed = np.asarray(confidences, dtype=float), np.asarray(right, dtype=bool)
    part = np.arange(len(stated)) % FOLDS
    foreseen = np.zeros(len(stated))
    for fold in range(FOLDS):
        own = part == fold
        if own.any():
            foreseen[own] = mapped(fit_confidence_map(stated[~own], observed[~own]), stated[own])
    return JudgedMap(
        fit_confidence_map(stated, observed),
        len(stated),
        expected_error(stated, observed),
        expected_error(foreseen, observed),
        error_by_chance(stated),
    )


def fit_to_scores(paths: Sequence[Path]) -> JudgedMap:
    """Return the map that fits the cases in the files `scores.json` of blind checks.

    Cases without a verdict do not count. A verdict is confirmed if it is right, or if it lists the
    truth as inseparable (`CaseScore.confirmed`).
    """
    cases = [
        case
        for path in paths
        for case in json.loads(path.read_text(encoding='utf-8'))['cases']
        if case.get('verdict') not in ('failed', 'refused')
    ]
    confirmed = [case['right'] or case.get('listed', False) for case in cases]
    return judged_map([case['confidence'] for case in cases], confirmed)


def main() -> None:
    """Print the map that fits the files on the command line."""
    found = fit_to_scores([Path(name) for name in sys.argv[1:]])
    print(
        f'{found.cases} cases: calibration error {found.error_stated:.3f} (true confidences would '
        f'have {found.error_by_chance:.3f} by chance); with the map scale '
        f'{found.fitted.scale:.2f}, shift {found.fitted.shift:.2f} it is {found.error_mapped:.3f} '
        f'by cross-validation. '
        + (
            'The map is better.'
            if found.kept != IDENTITY
            else f'Confidences stay as they are: at least {FEWEST_CASES} cases and a gain are '
            'needed.'
        )
    )


if __name__ == '__main__':
    main()
