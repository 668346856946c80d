"""The smallest strength of each effect that a recording could have shown."""

import math

import numpy as np

from porotwin_core.errors import InputError
from porotwin_diagnosis.candidates import LOCAL, library
from porotwin_diagnosis.evidence import WIDTH
from porotwin_diagnosis.fit import Fitter

VISIBLE = 0.5
"""Whitened change per cell with tracer at which an effect begins to stand clear of the noise."""


def smallest_strengths(fitter: Fitter) -> dict[str, dict[str, float | str]]:
    """Return by effect the parameter that counts, its unit, and the least deviation that shows.

    From the response of the whole picture to a small amount of the effect, alone, in the middle of
    the rig where it needs a place; deviations are from no effect (from 1 for a factor). Of several
    wells the one that shows most counts, of several parameters the first.
    """
    base = fitter.residuals((), WIDTH)
    cells = max(sum(sample.active for sample in fitter.samples), 1)
    found: dict[str, dict[str, float | str]] = {}
    for candidate in library(fitter.samples):
        turns = list(candidate.first)
        if not candidate.starts:
            turns[0] = 1.0 if candidate.effect != 'dispersion' else 0.0
        elif candidate.effect in LOCAL:
            turns[-1] = 1.0
        try:
            changed = fitter.residuals((candidate.described(turns),), WIDTH)
        except InputError:  # the model cannot run with it
            continue
        power = sum(float(np.sum((a - b) ** 2)) for a, b in zip(base, changed, strict=True))
        if power <= 0.0:
            continue
        main = len(turns) - 1 if candidate.effect in LOCAL else 0
        knob = candidate.knobs[main]
        deviation = abs(knob.value(turns[main]) - _absent(candidate.effect, knob.neutral))
        least = deviation * VISIBLE / math.sqrt(power / cells)
        known = found.get(candidate.effect)
        if known is None or (known['parameter'] == knob.name and least < float(known['value'])):
            found[candidate.effect] = {
                'parameter': knob.name,
                'value': float(f'{least:.3g}'),
                'unit': knob.unit,
            }
    return found


def _absent(effect: str, neutral: float) -> float:
    """Return the value at which the first knob does nothing; some start away from it."""
    return 0.0 if effect in ('dispersion', 'dual_porosity') else neutral
