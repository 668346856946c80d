"""A map from stated confidences to observed frequencies, fitted to the scores of blind checks.

    python -m porotwin_validation.confidence_fit blind/scores.json [MORE.json ...]

The diagnosis states its confidences without such a map. The fit says which one would make them
true: Platt's logistic map (in Advances in Large Margin Classifiers, MIT Press 1999)

    frequency = 1 / (1 + exp(-(scale * log_odds + shift)))

by maximum likelihood, with a weak prior at the identity (scale 1, shift 0), so that a few lucky
cases do not raise the confidences.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

PRIOR_WEIGHT = 2.0
"""Weight of the prior: a scale or a shift that is off by 1 costs as much as about two cases."""

LEAST_DOUBT = 1e-3
"""Least distance of a confidence from 0 and 1, so that log-odds stay finite."""

SCALE_RANGE, SHIFT_RANGE = (0.1, 5.0), (-5.0, 5.0)
"""Ranges of the map: beyond, it would turn every confidence into 0, 1/2 or 1."""


class ConfidenceMap(NamedTuple):
    """frequency = 1 / (1 + exp(-scale * log_odds - shift)); the identity is (1, 0)."""

    scale: float
    shift: float


def fit_confidence_map(confidences: Sequence[float], right: Sequence[bool]) -> ConfidenceMap:
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


def fit_to_scores(paths: Sequence[Path]) -> ConfidenceMap:
    """Return the map that fits the cases in the files `scores.json` of blind checks."""
    cases = [
        case for path in paths for case in json.loads(path.read_text(encoding='utf-8'))['cases']
    ]
    return fit_confidence_map(
        [case['confidence'] for case in cases], [case['right'] for case in cases]
    )


def main() -> None:
    """Print the map that fits the files on the command line."""
    found = fit_to_scores([Path(name) for name in sys.argv[1:]])
    print(f'scale {found.scale:.2f}, shift {found.shift:.2f} (1 and 0: confidences are true)')


if __name__ == '__main__':
    main()
