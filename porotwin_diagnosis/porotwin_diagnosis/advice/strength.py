"""The smallest strength of each effect that a recording could have shown."""

import math

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH
from porotwin_diagnosis.model.candidate import LOCAL, Candidate, library, nominal_parameters
from porotwin_diagnosis.model.fitter import Fitter

VISIBLE = 0.5
"""Whitened change per cell with tracer at which an effect begins to stand clear of the noise."""

STARTS_AWAY = ('dispersion', 'dual_porosity')
"""Effects whose first scaled are not those of no effect, at which the first parameter is zero."""


def smallest_strengths(fitter: Fitter) -> dict[str, dict[str, float | str]]:
    """Return by effect the parameter that counts, its unit, and the least deviation that shows.

    From the response of the whole picture to a small amount of the effect, alone, in the middle of
    the rig where it needs a place; deviations are from no effect (from 1 for a factor), or from
    what the rig description says of it already. Of several wells the one that shows most counts,
    of several parameters the first.
    """
    base = fitter.residuals((), SMOOTHING_WIDTH)
    cells = max(sum(sample.tracer_cells for sample in fitter.samples), 1)
    found: dict[str, dict[str, float | str]] = {}
    for candidate in library(fitter.samples):
        main, scaled, absent = _trial(candidate, fitter.samples[0].rig)
        try:
            changed = fitter.residuals((candidate.described(scaled),), SMOOTHING_WIDTH)
        except InputError:  # the model cannot run with it
            continue
        power = sum(float(np.sum((a - b) ** 2)) for a, b in zip(base, changed, strict=True))
        if power <= 0.0:
            continue
        parameter = candidate.parameters[main]
        deviation = abs(parameter.value(scaled[main]) - absent)
        least = deviation * VISIBLE / math.sqrt(power / cells)
        known = found.get(candidate.effect)
        if known is None or (
            known['parameter'] == parameter.name and least < float(known['value'])
        ):
            found[candidate.effect] = {
                'parameter': parameter.name,
                'value': float(f'{least:.3g}'),
                'unit': parameter.unit,
            }
    return found


def _trial(candidate: Candidate, rig: Rig) -> tuple[int, list[float], float]:
    """Return the index of the parameter that is tried, scaled parameters with a small amount of
    the effect, and the value of that parameter without the effect."""
    scaled = list(candidate.first)
    if candidate.effect in LOCAL:
        scaled[-1] = 1.0
        return len(scaled) - 1, scaled, candidate.parameters[-1].neutral
    parameter = candidate.parameters[0]
    if nominal_parameters(rig, candidate.effect) is not None:
        known = parameter.value(scaled[0])
        scaled[0] += 1.0
        return 0, scaled, known
    if candidate.effect in STARTS_AWAY:
        return 0, scaled, 0.0
    scaled[0] = 1.0
    return 0, scaled, parameter.neutral
