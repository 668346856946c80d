"""The smallest strength of each effect that a recording could have shown."""

import math

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig
from porotwin_diagnosis.candidates import LOCAL, Candidate, believed_parameters, library
from porotwin_diagnosis.evidence import WIDTH
from porotwin_diagnosis.fit import Fitter

VISIBLE = 0.5
"""Whitened change per cell with tracer at which an effect begins to stand clear of the noise."""

STARTS_AWAY = ('dispersion', 'dual_porosity')
"""Effects whose first turns are not those of no effect, at which the first knob is zero."""


def smallest_strengths(fitter: Fitter) -> dict[str, dict[str, float | str]]:
    """Return by effect the parameter that counts, its unit, and the least deviation that shows.

    From the response of the whole picture to a small amount of the effect, alone, in the middle of
    the rig where it needs a place; deviations are from no effect (from 1 for a factor), or from
    what the rig description says of it already. Of several wells the one that shows most counts,
    of several parameters the first.
    """
    base = fitter.residuals((), WIDTH)
    cells = max(sum(sample.active for sample in fitter.samples), 1)
    found: dict[str, dict[str, float | str]] = {}
    for candidate in library(fitter.samples):
        main, turns, absent = _trial(candidate, fitter.samples[0].rig)
        try:
            changed = fitter.residuals((candidate.described(turns),), WIDTH)
        except InputError:  # the model cannot run with it
            continue
        power = sum(float(np.sum((a - b) ** 2)) for a, b in zip(base, changed, strict=True))
        if power <= 0.0:
            continue
        knob = candidate.knobs[main]
        deviation = abs(knob.value(turns[main]) - absent)
        least = deviation * VISIBLE / math.sqrt(power / cells)
        known = found.get(candidate.effect)
        if known is None or (known['parameter'] == knob.name and least < float(known['value'])):
            found[candidate.effect] = {
                'parameter': knob.name,
                'value': float(f'{least:.3g}'),
                'unit': knob.unit,
            }
    return found


def _trial(candidate: Candidate, rig: Rig) -> tuple[int, list[float], float]:
    """Return which knob is tried, the turns with a small amount of the effect, and the value of
    that knob without it."""
    turns = list(candidate.first)
    if candidate.effect in LOCAL:
        turns[-1] = 1.0
        return len(turns) - 1, turns, candidate.knobs[-1].neutral
    knob = candidate.knobs[0]
    if believed_parameters(rig, candidate.effect) is not None:
        known = knob.value(turns[0])
        turns[0] += 1.0
        return 0, turns, known
    if candidate.effect in STARTS_AWAY:
        return 0, turns, 0.0
    turns[0] = 1.0
    return 0, turns, knob.neutral
