"""Confidence that means something: stated odds mapped to what came true in blind checks.

Platt's logistic map (in Advances in Large Margin Classifiers, MIT Press 1999): seen frequency =
1 / (1 + exp(-(scale * odds + shift))), by maximum likelihood, with a weak pull to leaving the odds
as they are, so that a few cases cannot make statements surer than they can prove.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

PULL = 2.0
"""Weight of the prior, in cases."""


def recalibrated(
    confidences: Sequence[float], right: Sequence[bool], *, scale: float = 1.0, shift: float = 0.0
) -> tuple[float, float]:
    """Return (scale, shift) for confidences that were stated with `scale` and `shift`."""
    stated = np.clip(np.asarray(confidences, dtype=float), 1e-3, 1 - 1e-3)
    odds = (np.log(stated / (1 - stated)) - shift) / scale
    came_true = np.asarray(right, dtype=float)

    def cost(values: np.ndarray) -> float:
        logits = values[0] * odds + values[1]
        likelihood = np.sum(np.logaddexp(0.0, logits) - came_true * logits)
        return float(likelihood + PULL * ((values[0] - 1.0) ** 2 + values[1] ** 2))

    found = minimize(cost, np.array([scale, shift]), bounds=[(0.1, 5.0), (-5.0, 5.0)])
    return float(found.x[0]), float(found.x[1])


def recalibrate_from(scores: Sequence[Path], calibration: Path) -> tuple[float, float]:
    """Refit the map in the file `calibration` to `scores.json` of blind checks; return it."""
    cases = [
        case for path in scores for case in json.loads(path.read_text(encoding='utf-8'))['cases']
    ]
    content = json.loads(calibration.read_text(encoding='utf-8'))
    limits = content['thresholds']
    limits['scale'], limits['shift'] = recalibrated(
        [case['confidence'] for case in cases],
        [case['right'] for case in cases],
        scale=limits['scale'],
        shift=limits['shift'],
    )
    content['made_from'] = f'blind checks of {len(cases)} cases on the virtual rig'
    calibration.write_text(json.dumps(content, indent=2) + '\n', encoding='utf-8')
    return limits['scale'], limits['shift']
